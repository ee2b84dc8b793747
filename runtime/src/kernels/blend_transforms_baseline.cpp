// Linear blend skinning's transforms, a texel at a time: the specification of every other kernel.
//
// Based on: Loper et al., SMPL, 2015, eq. 2-4. The sums are those of figurine::blend (pose.h).
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {

void blend_transforms_baseline(const BlendTransformsJob& job) {
  const TexelBlock& texels = *job.texels;
  TransformBlock& out = *job.transforms;
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    float mean[12] = {}, own_translation[3] = {};
    for (uint32_t k = 0; k < kInfluences; ++k) {
      const float weight = texels.weight[k][lane];
      if (weight == 0) continue;
      const float* joint = job.mean_from_rest + 12 * uint32_t{texels.joint[k][lane]};
      const float* own = job.own_from_rest + 12 * uint32_t{texels.joint[k][lane]};
      for (int i = 0; i < 12; ++i) mean[i] += weight * joint[i];
      for (int i = 0; i < 3; ++i) own_translation[i] += weight * own[4 * i + 3];
    }
    for (int row = 0; row < 3; ++row) {
      for (int i = 0; i < 3; ++i) out.linear[3 * row + i][lane] = mean[4 * row + i];
      out.mean_translation_m[row][lane] = mean[4 * row + 3];
      out.own_translation_m[row][lane] = own_translation[row];
    }
  }
}

}  // namespace figurine::kernels
