// A motion: poses of one skeleton at a fixed rate.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/pose.h"

namespace figurine {

struct Motion {
  std::string name;
  float frames_per_second = 0;
  std::vector<std::string> joint_names;       // [J] must equal the body's
  uint32_t frame_count = 0;                   // F >= 1
  std::span<const float> root_translation_m;  // [F,3] of the root joint from its rest position
  std::span<const float> rotations;           // [F,J,4] unit quaternions, wxyz

  PoseView pose(uint32_t frame) const {
    const size_t joints = joint_names.size();
    return {{root_translation_m[frame * 3], root_translation_m[frame * 3 + 1],
             root_translation_m[frame * 3 + 2]},
            rotations.subspan(frame * joints * 4, joints * 4)};
  }
};

}  // namespace figurine
