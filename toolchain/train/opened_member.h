// A population's member with the storage that its weights live in, and the poses in which members
// are compared. No LibTorch.
#pragma once

#include <cstddef>
#include <vector>

#include "figurine/motion.h"
#include "figurine/population.h"
#include "toolchain/train/owned_pose.h"

namespace figurine::train {

struct OpenedMember {
  OpenedMember(const Population& population, size_t member);
  OpenedMember(const OpenedMember&) = delete;
  std::vector<float> storage;
  Avatar avatar;
};

// Poses in which all members are drawn, above the origin. Of a motion: frames spread over it.
// Without one: golden poses of training members, the first one's and then always the one that
// differs most from those that were taken. Throws InputError if there are none.
std::vector<OwnedPose> fixed_poses(const Population& population, const Motion* motion,
                                   size_t count);

}  // namespace figurine::train
