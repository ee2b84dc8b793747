// Where a pose puts the joints of a body.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "figurine/body.h"
#include "toolchain/body/skeleton.h"

namespace figurine::body::test {

// World positions of the joints of one pose.
inline std::vector<Eigen::Vector3f> joints_of(const figurine::Body& body, const PoseView& pose) {
  std::vector<Affine> transforms(kJointCount);
  skinning_transforms(body.mean_skeleton(), pose, transforms);
  std::vector<Eigen::Vector3f> out;
  for (size_t j = 0; j < kJointCount; ++j) {
    const auto p = transform_point(transforms[j], &body.joint_position_m[3 * j]);
    out.emplace_back(p[0], p[1], p[2]);
  }
  return out;
}

inline Eigen::Vector3f direction(const std::vector<Eigen::Vector3f>& joints, int from, int to) {
  return (joints[static_cast<size_t>(to)] - joints[static_cast<size_t>(from)]).normalized();
}

}  // namespace figurine::body::test
