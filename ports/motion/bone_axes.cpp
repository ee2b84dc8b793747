#include "ports/motion/bone_axes.h"

#include <cmath>
#include <numbers>

namespace figurine::ports {
namespace {

constexpr double kMaxBoneAngleRad =
    0.35;  // from a joint's y axis to the next joint, if the rig is the known one
constexpr double kFootPitchRad = 26 * std::numbers::pi / 180;

Quat axes(const Vec3& x, const Vec3& y) { return quaternion_of({x, y, cross(x, y)}); }

}  // namespace

std::optional<Quat> neutral_axes(int joint) {
  const Vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  if (joint == kPelvis || (joint >= kLeftHip && joint <= kRightHip) || joint == kLeftKnee ||
      joint == kRightKnee)
    return axes(-x, -y);
  if (joint == kLeftAnkle || joint == kRightAnkle)
    return axes(x, Vec3(0, -std::sin(kFootPitchRad), std::cos(kFootPitchRad)));
  if (joint == kLeftFoot || joint == kRightFoot) return axes(x, z);
  if (joint >= kJaw && joint <= kRightEye) return std::nullopt;
  if (joint <= kNeck || joint == kHead) return axes(x, y);
  const bool is_left = joint == kLeftCollar || joint == kLeftShoulder || joint == kLeftElbow ||
                       joint == kLeftWrist || (joint >= kLeftIndex1 && joint < kRightIndex1);
  return axes(y, is_left ? x : -x);
}

int bone_end_of(int joint) {
  switch (joint) {
    case kLeftHip:
    case kRightHip:
    case kLeftKnee:
    case kRightKnee:
      return joint + 3;
    case kLeftAnkle:
    case kRightAnkle:
      return joint + 3;
    case kLeftShoulder:
    case kRightShoulder:
    case kLeftElbow:
    case kRightElbow:
      return joint + 2;
    case kLeftWrist:
      return kLeftMiddle1;
    case kRightWrist:
      return kRightMiddle1;
    default:
      break;
  }
  return joint >= kLeftIndex1 && (joint - kLeftIndex1) % 3 != 2 ? joint + 1 : -1;
}

std::string not_the_known_rig(const ClipTree& tree, const JointNodes& joints,
                              const WorldPose& pose) {
  const auto named = [&](int joint) {
    return "nodes[" + std::to_string(joints.at(joint)) + "] (" + tree.names[joints.at(joint)] + ")";
  };
  for (int joint = 0; joint < kLeftIndex1; ++joint) {
    const int end = bone_end_of(joint);
    if (end < 0 || end >= kLeftIndex1 || !joints.has(joint) || !joints.has(end)) continue;
    const Vec3 along = pose.position[joints.at(end)] - pose.position[joints.at(joint)];
    const Vec3 axis = rotated(pose.rotation[joints.at(joint)], Vec3(0, 1, 0));
    if (!(dot(along, axis) > std::cos(kMaxBoneAngleRad) * length(along)))
      return named(joint) + ": its y axis is not along the bone";
  }
  const Quat to_neutral =
      product(*neutral_axes(kPelvis), reversed(pose.rotation[joints.at(kPelvis)]));
  const Vec3 across =
      rotated(to_neutral, pose.position[joints.at(kLeftHip)] - pose.position[joints.at(kRightHip)]);
  if (!(across.x > std::cos(kMaxBoneAngleRad) * length(across)))
    return named(kPelvis) + ": the left leg is not at -x of its axes";
  return "";
}

}  // namespace figurine::ports
