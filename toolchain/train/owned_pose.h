// A pose with its own arrays.
#pragma once

#include <array>
#include <vector>

#include "figurine/pose.h"

namespace figurine::train {

struct OwnedPose {
  std::array<float, 3> root_translation_m{0, 0, 0};
  std::vector<float> rotations;  // [J,4]
  PoseView view() const { return {root_translation_m, rotations}; }
};

}  // namespace figurine::train
