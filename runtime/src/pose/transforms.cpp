#include "runtime/src/pose/transforms.h"

#include <algorithm>

namespace figurine {
namespace {

constexpr uint32_t kBlocksPerTask = 32;

static_assert(sizeof(Affine) == 12 * sizeof(float));

}  // namespace

bool Transforms::ensure(uint32_t joints, uint32_t blocks) {
  return mean_from_rest_.ensure(joints) && own_from_rest_.ensure(joints) && blended_.ensure(blocks);
}

void Transforms::pose(const Body& body, const BodyBlocks& blocks,
                      std::span<const float> own_joint_position_m, const PoseView& pose,
                      ThreadPool& pool, const KernelTable& kernels) {
  const uint32_t joints = body.joint_count();
  skinning_transforms(body.mean_skeleton(), pose, mean_from_rest_.span(joints));
  skinning_transforms({body.parents, own_joint_position_m}, pose, own_from_rest_.span(joints));
  const uint32_t count = blocks.count();
  pool.for_each((count + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
    const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask;
    for (uint32_t block = begin; block < std::min(begin + kBlocksPerTask, count); ++block) {
      kernels.blend_transforms({.texels = &blocks[block],
                                .mean_from_rest = mean_from_rest_.data()->m.data(),
                                .own_from_rest = own_from_rest_.data()->m.data(),
                                .transforms = &blended_[block]});
    }
  });
}

}  // namespace figurine
