#include "runtime/src/pose/static_blocks.h"

#include <memory>

#include "runtime/src/base/float_math.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/body_grid.h"

namespace figurine {
namespace {

// s of one of the group's channels at one lane of a block (figurine/texel_grid.h).
float value_at(const StaticGroup& group, uint32_t channel, const BodyGrid& grid, uint32_t block,
               uint32_t lane, uint32_t texels) {
  const auto of_cell = [&](size_t row) {
    return group.scale[channel] * static_cast<float>(group.values[row * group.channels + channel]);
  };
  const kernels::TapBlock* const taps = grid.taps(block);
  if (taps == nullptr) return of_cell(texel_of_lane(block, lane, texels));
  float weighted[kernels::kTaps];
  for (uint32_t k = 0; k < kernels::kTaps; ++k)
    weighted[k] = taps->weight[k][lane] * of_cell(taps->row[k][lane]);
  return (weighted[0] + weighted[1]) + (weighted[2] + weighted[3]);
}

float* plane_of(kernels::StaticBlock& block, uint32_t head_channel) {
  return head_channel < kStaticColour ? block.sum[head_channel]
                                      : block.gain[head_channel - kStaticColour];
}

}  // namespace

Status StaticBlocks::ensure(const StaticPart& part, const Body& body) {
  if (part.empty()) return {};
  const uint32_t texels = body.texel_count(),
                 count = (texels + kernels::kLanes - 1) / kernels::kLanes;
  if (!blocks_.ensure(count)) return out_of_memory("an avatar's static part");
  std::shared_ptr<const BodyGrid> grid;
  for (const StaticGroup& group : part.groups) {
    if (grid == nullptr || grid->size() != group.grid_size)
      grid = BodyGrid::create(body, group.grid_size);
    if (grid == nullptr) return out_of_memory("a grid over a body's texels");
    for (uint32_t block = 0; block < count; ++block) {
      for (uint32_t c = 0; c < group.channels; ++c) {
        float* const plane = plane_of(blocks_[block], group.first_channel + c);
        for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
          plane[lane] = value_at(group, c, *grid, block, lane, texels);
      }
    }
  }
  for (uint32_t block = 0; block < count; ++block) {
    for (auto& plane : blocks_[block].gain) {
      for (float& value : plane) value = exp_float(value);
    }
  }
  return {};
}

}  // namespace figurine
