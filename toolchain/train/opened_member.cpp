#include "toolchain/train/opened_member.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"

namespace figurine::train {

namespace {

// A member's pose stands where it was captured; everybody is drawn above the origin.
OwnedPose above_origin(const PoseView& pose) {
  return {{0, pose.root_translation_m[1], 0}, {pose.rotations.begin(), pose.rotations.end()}};
}

// Sum over the joints of 1 - |cos(angle / 2)|: grows with every joint's turn from one pose to the
// other.
double pose_difference(const OwnedPose& a, const OwnedPose& b) {
  double sum = 0;
  for (size_t j = 0; j + 3 < a.rotations.size(); j += 4) {
    double dot = 0, aa = 0, bb = 0;
    for (size_t k = j; k < j + 4; ++k) {
      dot += double(a.rotations[k]) * b.rotations[k];
      aa += double(a.rotations[k]) * a.rotations[k];
      bb += double(b.rotations[k]) * b.rotations[k];
    }
    sum += 1 - std::abs(dot) / std::sqrt(aa * bb);
  }
  return sum;
}

}  // namespace

OpenedMember::OpenedMember(const Population& population, size_t member)
    : storage(member_floats(population)), avatar(open_member(population, member, storage)) {}

std::vector<OwnedPose> fixed_poses(const Population& population, const Motion* motion,
                                   size_t count) {
  std::vector<OwnedPose> poses, candidates;
  if (motion != nullptr) {
    for (size_t i = 0; i < count; ++i)
      poses.push_back(
          above_origin(motion->pose(uint32_t((2 * i + 1) * motion->frame_count / (2 * count)))));
    return poses;
  }
  for (const PopulationMember& member : population.members) {
    if (member.split == Split::kTrain && !member.golden.rotations.empty())
      candidates.push_back(
          above_origin({member.golden.root_translation_m, member.golden.rotations}));
  }
  if (candidates.empty())
    throw InputError("population '" + population.name +
                     "': its members have no golden pose; give a motion");
  poses.push_back(candidates.front());
  while (poses.size() < count) {
    const auto difference = [&](const OwnedPose& candidate) {
      double least = 1e9;
      for (const OwnedPose& taken : poses)
        least = std::min(least, pose_difference(candidate, taken));
      return least;
    };
    poses.push_back(*std::max_element(
        candidates.begin(), candidates.end(),
        [&](const auto& a, const auto& b) { return difference(a) < difference(b); }));
  }
  return poses;
}

}  // namespace figurine::train
