// Skinning transforms of one pose: of the joints, and blended once a frame for every texel.
//
// The mean template's transforms draw the maps, the avatar's own move its Gaussians. They differ in
// their translations alone, because a joint's rotation does not depend on where joints rest.
//
// Based on: Loper et al., SMPL, 2015, eq. 2-4.
#pragma once

#include <span>

#include "figurine/body.h"
#include "figurine/pose.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/body_blocks.h"

namespace figurine {

class Transforms {
 public:
  bool ensure(uint32_t joints, uint32_t blocks);  // false: no memory

  // The pose must be valid for the body. own_joint_position_m: [J,3] where the avatar's joints
  // rest.
  void pose(const Body& body, const BodyBlocks& blocks, std::span<const float> own_joint_position_m,
            const PoseView& pose, ThreadPool& pool, const KernelTable& kernels);

  const kernels::TransformBlock& operator[](size_t block) const { return blended_[block]; }
  uint64_t memory_bytes() const {
    return mean_from_rest_.memory_bytes() + own_from_rest_.memory_bytes() + blended_.memory_bytes();
  }

 private:
  Buffer<Affine> mean_from_rest_, own_from_rest_;  // [J]
  Buffer<kernels::TransformBlock> blended_;        // [blocks]
};

}  // namespace figurine
