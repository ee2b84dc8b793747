#include "runtime/src/pose/extent_blocks.h"

#include <algorithm>

#include "runtime/src/pose/body_blocks.h"

namespace figurine {

Status ExtentBlocks::ensure(const SmallestExtents& extents, const Body& body) {
  if (extents.empty()) return {};
  const uint32_t texels = body.texel_count(),
                 count = (texels + kernels::kLanes - 1) / kernels::kLanes;
  if (!blocks_.ensure(count)) return out_of_memory("an avatar's smallest extents");
  for (uint32_t block = 0; block < count; ++block) {
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const float s = extents.extent_m(texel_of_lane(block, lane, texels));
      blocks_[block].smallest_m[lane] = s;
      largest_m_ = std::max(largest_m_, s);
    }
  }
  return {};
}

}  // namespace figurine
