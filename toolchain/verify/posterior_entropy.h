// Where along a noise schedule it is decided which training member a noisy vector came from: the
// mean entropy of the members' posterior (generate/oracle.h), ln N where nothing is decided yet and
// 0 where all is. A denoiser trained above the band alone is a look-up table.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/generate/oracle.h"

namespace figurine::verify {

struct EntropyOptions {
  uint32_t draws = 32;  // of noise a level, each for another member
  uint64_t seed = 0;
};

// Means over draws at each of the levels, in nats. members: [N,D] model vectors. The draws are the
// same at every level.
std::vector<double> posterior_entropy(const generate::RowMatrix& members,
                                      const std::vector<NoiseLevel>& levels,
                                      const EntropyOptions& options = {});

}  // namespace figurine::verify
