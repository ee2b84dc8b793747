// What the readers of motion files hand to the retargeting: a motion in terms of the 55 joints,
// whatever file it comes from. Internal.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "toolchain/body/retarget.h"
#include "toolchain/body/skeleton.h"

namespace figurine::body {

struct RetargetSource {
  std::string where;
  double frames_per_second = 0;
  uint32_t frames = 0;
  std::array<bool, kJointCount> driven{};
  std::vector<Eigen::Quaterniond>
      world_from_neutral;             // [F,55] R(t) R(neutral)^T; only driven joints are read
  std::vector<Eigen::Vector3d> hips;  // [F] middle of the hip joints, y up, in the file's unit
  std::array<Eigen::Vector3d, kJointCount>
      direction;   // bones of limbs and fingers in the neutral pose; zero: not known
  double leg = 0;  // thigh + shin, in the file's unit
  double tolerance_rad =
      0;  // arms that lie nearer than this to the neutral direction are taken as they are
  float smooth_s = 0;  // where the options do not say

  RetargetSource() { direction.fill(Eigen::Vector3d::Zero()); }
};

// InputError naming the source: a start beyond the end, more frames than there are, ...
MotionClip retarget(RetargetSource source, const figurine::Body& body,
                    const RetargetOptions& options, uint32_t start, RetargetReport* report_out);

}  // namespace figurine::body
