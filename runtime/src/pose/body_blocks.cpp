#include "runtime/src/pose/body_blocks.h"

namespace figurine {

bool BodyBlocks::ensure(const Body& body) {
  texels_ = body.texel_count();
  count_ = (texels_ + kernels::kLanes - 1) / kernels::kLanes;
  if (!blocks_.ensure(count_)) return false;
  for (uint32_t block = 0; block < count_; ++block) {
    kernels::TexelBlock& out = blocks_[block];
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const size_t i = texel_of_lane(block, lane, texels_);
      for (size_t k = 0; k < 3; ++k) {
        out.mean_position_m[k][lane] = body.texel_position_m[3 * i + k];
        out.mean_normal[k][lane] = body.texel_normal[3 * i + k];
      }
      for (size_t k = 0; k < kSkinInfluences; ++k) {
        out.joint[k][lane] = body.texel_joints[kSkinInfluences * i + k];
        out.weight[k][lane] = body.texel_weights[kSkinInfluences * i + k];
      }
    }
  }
  return true;
}

}  // namespace figurine
