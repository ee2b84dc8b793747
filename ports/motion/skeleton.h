// The 55 joints of SMPL-X: names, order and parents. Every body of this project uses them, whatever
// mesh it comes from.
//
// Based on: Pavlakos et al., Expressive Body Capture: 3D Hands, Face, and Body from a Single Image
// (SMPL-X), 2019: the joint tree only, no data.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace figurine::ports {

inline constexpr uint32_t kJointCount = 55;

// Indices that code speaks of by name. Left is the figure's own left, +x for a figure that faces
// +z.
enum Joint : uint8_t {
  kPelvis = 0,
  kLeftHip = 1,
  kRightHip = 2,
  kSpine1 = 3,
  kLeftKnee = 4,
  kRightKnee = 5,
  kSpine2 = 6,
  kLeftAnkle = 7,
  kRightAnkle = 8,
  kSpine3 = 9,
  kLeftFoot = 10,
  kRightFoot = 11,
  kNeck = 12,
  kLeftCollar = 13,
  kRightCollar = 14,
  kHead = 15,
  kLeftShoulder = 16,
  kRightShoulder = 17,
  kLeftElbow = 18,
  kRightElbow = 19,
  kLeftWrist = 20,
  kRightWrist = 21,
  kJaw = 22,
  kLeftEye = 23,
  kRightEye = 24,
  kLeftIndex1 = 25,  // then index 2, 3, middle 1..3, pinky 1..3, ring 1..3, thumb 1..3
  kLeftMiddle1 = 28,
  kLeftPinky1 = 31,
  kLeftRing1 = 34,
  kLeftThumb1 = 37,
  kRightIndex1 = 40,
  kRightMiddle1 = 43,
  kRightPinky1 = 46,
  kRightRing1 = 49,
  kRightThumb1 = 52,
};

// [55] parents[0] = -1, parents[j] < j.
const std::array<int16_t, kJointCount>& joint_parents();

// [55] "pelvis", "left_hip", ...
const std::vector<std::string>& joint_names();

}  // namespace figurine::ports
