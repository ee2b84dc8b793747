// The network's input of a pose: maps of position and normal of the mean template, on the network's
// grid.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/body.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/body_grid.h"
#include "runtime/src/pose/transforms.h"

namespace figurine {

// [G,G,stride] floats; the first kMapChannels of each cell are the maps.
struct MapTarget {
  float* values = nullptr;
  uint32_t stride = 0;
};

// For covered and border cells; every other cell is left as it is and must be zero. A cell has what
// figurine::draw_pose_maps (body.h) draws for its source texel, to the bit; where every texel is
// its own cell that is all of those maps.
void draw_maps(const BodyGrid& grid, const BodyBlocks& blocks, const Transforms& transforms,
               const std::array<float, 3>& root_m, const MapStatistics& statistics,
               const MapTarget& target, ThreadPool& pool, const KernelTable& kernels);

}  // namespace figurine
