// What each layer of a network costs in the very frame in which it runs: XNNPACK's own times by
// operator, by the program's profile clock. The runtime is as it is; its calls of XNNPACK are
// wrapped when the program is linked (--wrap).
//
// For programs with one network in fixed point and one thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "figurine/network.h"
#include "figurine/status.h"

namespace figurine::bench {

// RendererOptions::now_ns: the profile clock, which also notes its reads before and after a
// run of XNNPACK. Those are where the network's stage begins and ends.
uint64_t read_stage_clock(void* unused);

struct LayerCost {
  std::string name;  // "3x3, 64 to 32 channels, 64x64", "max pool, 32 channels, 32x32"
  uint64_t macs = 0;
  uint64_t count = 0;  // of the profile clock
};

// Of the last run; sums to its stage. The first and the last convolution are the runtime's own: the
// first's entry holds all that comes before XNNPACK, the last's all that comes behind. kMismatch if
// XNNPACK's operators are not the other layers.
Result<std::vector<LayerCost>> last_run(const Network& network);

}  // namespace figurine::bench
