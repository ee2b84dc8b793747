// What a package says of the poses that its network was trained on (figurine/known_poses.h): of
// training poses their mean, covariance and how far each is from the others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/package.h"

namespace figurine::train {

// Of a table of distances.
inline constexpr size_t kPoseDistances = 65;
// Parts of a row of poses that are measured against the others, one after the other.
inline constexpr size_t kPoseFolds = 8;

struct KnownPoseStatistics {
  std::vector<uint8_t> joints;  // [P] the root and the 21 SMPL-X body joints, as far as there are
  std::vector<float> mean, covariance;  // [3P], [3P,3P] with kPoseDeviation_rad^2 on the diagonal
  std::vector<float> distances;         // [kPoseDistances]

  PoseStatistics view() const { return {joints, mean, covariance, distances}; }
};

// poses: [F] of J rotations [J,4] each, in the order of their motions. A pose's distance is that to
// mean and covariance of the poses outside of its own part of the row: to its own it would be
// flattered, because F poses are not many for 3P dimensions, and so would the network's knowledge
// of it. Of a single pose the distance is its own. Throws InputError: no poses.
KnownPoseStatistics known_poses(const std::vector<std::vector<float>>& poses, uint32_t joint_count);

// The package again, with these statistics in place of its own, if any. Everything else stays: with
// the statistics that it has, so do its bytes. kind must be kAvatar.
std::vector<std::byte> with_known_poses(const Package& avatar,
                                        const KnownPoseStatistics& statistics);

}  // namespace figurine::train
