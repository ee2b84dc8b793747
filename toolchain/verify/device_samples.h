// The people of a sampler package, as a device samples them: what ships, for evaluations that need
// no run folder.
#pragma once

#include <cstdint>

#include "figurine/sampler.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::verify {

struct DeviceSamplesOptions {
  uint64_t first_seed = 0;
  size_t count = 1;    // S
  uint32_t steps = 0;  // evaluations; 0: the package's
  bool quiet = false;
};

// Seeds first_seed, first_seed + 1, ...: [S,W] weights before they are rounded to an avatar's int8,
// in the order of a population's members. sampler: of an opened package. Throws InputError if one
// cannot be sampled, or train::Interrupted.
measure::RowMatrix sample_weights(const Sampler& sampler, const DeviceSamplesOptions& options);

}  // namespace figurine::verify
