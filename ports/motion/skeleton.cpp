#include "ports/motion/skeleton.h"

namespace figurine::ports {

const std::array<int16_t, kJointCount>& joint_parents() {
  static constexpr std::array<int16_t, kJointCount> kParents = {
      -1, 0,  0,  0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  9,  9,  12, 13, 14, 16,
      17, 18, 19, 15, 15, 15, 20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20,
      37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53};
  return kParents;
}

const std::vector<std::string>& joint_names() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names = {
        "pelvis",        "left_hip",       "right_hip",    "spine1",
        "left_knee",     "right_knee",     "spine2",       "left_ankle",
        "right_ankle",   "spine3",         "left_foot",    "right_foot",
        "neck",          "left_collar",    "right_collar", "head",
        "left_shoulder", "right_shoulder", "left_elbow",   "right_elbow",
        "left_wrist",    "right_wrist",    "jaw",          "left_eye",
        "right_eye"};
    for (const char* side : {"left", "right"}) {
      for (const char* finger : {"index", "middle", "pinky", "ring", "thumb"}) {
        for (int i = 1; i <= 3; ++i)
          names.push_back(std::string(side) + "_" + finger + std::to_string(i));
      }
    }
    return names;
  }();
  return kNames;
}

}  // namespace figurine::ports
