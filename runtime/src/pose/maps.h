// The network's input of a pose: maps of position and normal of the mean template.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/body.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/transforms.h"

namespace figurine {

// [T,T,stride] floats; the first kMapChannels of each texel are the maps.
struct MapTarget {
  float* values = nullptr;
  uint32_t stride = 0;
};

// As figurine::draw_pose_maps (body.h), to the bit, for covered and border texels; every other
// texel is left as it is and must be zero.
void draw_maps(const Body& body, const BodyBlocks& blocks, const Transforms& transforms,
               const std::array<float, 3>& root_m, const MapStatistics& statistics,
               const MapTarget& target, ThreadPool& pool, const KernelTable& kernels);

}  // namespace figurine
