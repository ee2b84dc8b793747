// A motion in memory: poses of the 55 joints at a fixed rate, owned. What the motion commands write
// and the capture tool plays.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/motion.h"
#include "figurine/status.h"

namespace figurine::ports {

// One pose, owned. view() borrows.
struct OwnedPose {
  std::array<float, 3> root_translation_m{0, 0, 0};
  std::vector<float> rotations;  // [55,4] wxyz
  PoseView view() const { return {root_translation_m, rotations}; }
};

struct MotionClip {
  std::string name;
  float frames_per_second = 30;
  uint32_t frame_count = 0;
  std::vector<float> root_translation_m;  // [F,3]
  std::vector<float> rotations;  // [F,55,4] unit, wxyz, sign-continuous from frame to frame

  figurine::Motion view() const;  // borrows
  OwnedPose pose(uint32_t frame) const;
};

// Reads a motion package and copies it out. Errors name the file; kMismatch if it is no motion of
// the 55 joints of SMPL-X.
Result<MotionClip> read_motion_clip(const std::string& path);

// The pose turned about the vertical line through the root joint by angle_rad (positive: from +z
// towards +x): the same pose under another heading.
OwnedPose turned(OwnedPose pose, float angle_rad);

// The rest pose: all rotations identity.
OwnedPose rest_pose();

// Makes quaternions [F,J,4] unit and sign-continuous. Quaternions shorter than 1e-6 become the
// identity.
void make_continuous(std::vector<float>& rotations, uint32_t joints);

}  // namespace figurine::ports
