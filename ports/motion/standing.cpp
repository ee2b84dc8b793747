#include "ports/motion/standing.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace figurine::ports {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kNearRightAngle = 25 / kDegrees;
constexpr double kMostLean = 12, kMostTurn = 25, kMostForward = 35, kMostElbow = 35, kMostLeg = 27;
constexpr double kMostStretch = 1.5;
constexpr double kLeastRatio = 0.5, kMostRatio = 2;
constexpr double kMostSpeed_m_s = 20;  // a sprinter: 12

Vec3 middle(const JointPlaces& places, int left, int right) {
  return 0.5 * (places[static_cast<size_t>(left)] + places[static_cast<size_t>(right)]);
}
Vec3 trunk_of(const JointPlaces& places) {
  return unit(middle(places, kLeftShoulder, kRightShoulder) - middle(places, kLeftHip, kRightHip));
}

double angle(const Vec3& a, const Vec3& b) {
  return kDegrees * std::acos(std::clamp(dot(a, b), -1.0, 1.0));
}

std::string degrees(const char* what, double value) {
  return what + (" by " + std::to_string(std::lround(value))) + " degrees";
}

// The nearest of the 24 rotations of the axes onto each other, or the rotation itself if none is
// near.
Quat by_right_angles(const Quat& rotation) {
  for (const ClipUp up :
       {ClipUp::kY, ClipUp::kZ, ClipUp::kX, ClipUp::kMinusY, ClipUp::kMinusZ, ClipUp::kMinusX}) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      Quat whole = world_from_clip(up);
      if (quarter > 0) whole = product(about(Vec3(0, 1, 0), quarter * std::numbers::pi / 2), whole);
      if (angle_between(whole, rotation) < kNearRightAngle) return whole;
    }
  }
  return rotation;
}

struct Bone {
  int from, to;
};
constexpr Bone kBones[] = {{kLeftHip, kLeftKnee},       {kRightHip, kRightKnee},
                           {kLeftKnee, kLeftAnkle},     {kRightKnee, kRightAnkle},
                           {kLeftShoulder, kLeftElbow}, {kRightShoulder, kRightElbow},
                           {kLeftElbow, kLeftWrist},    {kRightElbow, kRightWrist}};
constexpr size_t kBoneCount = std::size(kBones);  // and the trunk

double bone_length(const JointPlaces& places, size_t bone) {
  if (bone == kBoneCount) {
    return length(middle(places, kLeftShoulder, kRightShoulder) -
                  middle(places, kLeftHip, kRightHip));
  }
  return length(places[static_cast<size_t>(kBones[bone].to)] -
                places[static_cast<size_t>(kBones[bone].from)]);
}
int bone_joint(size_t bone) { return bone == kBoneCount ? int{kSpine1} : kBones[bone].from; }

const char* bone_name(int joint) {
  constexpr const char* kNames[] = {"left thigh",   "right thigh",    "left shin",
                                    "right shin",   "left upper arm", "right upper arm",
                                    "left forearm", "right forearm",  "trunk"};
  for (size_t b = 0; b <= kBoneCount; ++b) {
    if (bone_joint(b) == joint) return kNames[b];
  }
  return "";
}

std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

}  // namespace

Quat upright_by_itself(const JointPlaces& places) {
  const Vec3 up = trunk_of(places);
  const Vec3 across = places[kLeftHip] - places[kRightHip];
  const Vec3 left = unit(across - dot(across, up) * up);
  if (!(length(up) > 0.5) || !(length(left) > 0.5)) return no_turn();
  const Quat clip_from_upright = quaternion_of({left, up, cross(left, up)});
  return by_right_angles(reversed(clip_from_upright));
}

Quat facing_forward(const JointPlaces& places, const Quat& world_up) {
  const Vec3 left = rotated(world_up, places[kLeftHip] - places[kRightHip]);
  if (!(std::hypot(left.x, left.z) > 1e-9)) return world_up;
  double heading = std::atan2(-left.z, left.x);
  constexpr double kRight = std::numbers::pi / 2;
  const double whole = kRight * std::round(heading / kRight);
  if (std::abs(heading - whole) < kNearRightAngle) heading = whole;
  return heading == 0 ? world_up : product(about(Vec3(0, 1, 0), -heading), world_up);
}

std::string no_t_pose(const JointPlaces& places, const std::array<bool, kJointCount>& known,
                      const Quat& upright, double most_drop_deg) {
  const auto along = [&](int from, int to) {
    return unit(
        rotated(upright, places[static_cast<size_t>(to)] - places[static_cast<size_t>(from)]));
  };
  const Vec3 x(1, 0, 0), y(0, 1, 0);
  if (const double lean = angle(rotated(upright, trunk_of(places)), y); lean > kMostLean)
    return degrees("its trunk leans", lean);
  if (const double turn = angle(along(kRightHip, kLeftHip), x); turn > kMostTurn)
    return degrees("its hips are turned", turn);
  if (const double turn = angle(along(kRightShoulder, kLeftShoulder), x); turn > kMostTurn)
    return degrees("its shoulders are turned", turn);
  for (int side = 0; side < 2; ++side) {
    const std::string s = side == 0 ? "its left " : "its right ";
    const Vec3 upper = along(kLeftShoulder + side, kLeftElbow + side),
               fore = along(kLeftElbow + side, kLeftWrist + side);
    for (const Vec3& arm : {upper, fore}) {
      const double drop = angle(arm, y) - 90, out = side == 0 ? arm.x : -arm.x;
      if (drop > most_drop_deg) return degrees((s + "arm hangs").c_str(), drop);
      if (drop < -kTPoseDrop) return degrees((s + "arm is raised").c_str(), -drop);
      if (std::abs(arm.z) > std::sin(kMostForward / kDegrees) || out < 0)
        return s + "arm does not point outwards";
    }
    if (const double bend = angle(upper, fore); bend > kMostElbow)
      return degrees((s + "elbow is bent").c_str(), bend);
    for (const Vec3& leg :
         {along(kLeftHip + side, kLeftKnee + side), along(kLeftKnee + side, kLeftAnkle + side)}) {
      if (const double bend = angle(leg, -y); bend > kMostLeg)
        return degrees((s + "leg is bent").c_str(), bend);
    }
    if (known[static_cast<size_t>(kLeftFoot + side)] &&
        along(kLeftAnkle + side, kLeftFoot + side).z < -0.3)
      return s + "toes point backwards (left and right may be exchanged)";
  }
  return "";
}

void Stance::add(const JointPlaces& places) {
  const Vec3 hips = middle(places, kLeftHip, kRightHip);
  add(trunk_of(places), unit(middle(places, kLeftAnkle, kRightAnkle) - hips), hips);
}

void Stance::add(const Vec3& trunk, const Vec3& legs, const Vec3& hips) {
  trunk_ += trunk;
  legs_ += legs;
  for (int i = 0; i < 3; ++i) {
    least_[i] = count_ == 0 ? hips[i] : std::min(least_[i], hips[i]);
    most_[i] = count_ == 0 ? hips[i] : std::max(most_[i], hips[i]);
  }
  ++count_;
}

Vec3 Stance::mean_trunk() const { return trunk_ / double(std::max(1u, count_)); }
Vec3 Stance::mean_legs() const { return legs_ / double(std::max(1u, count_)); }

// One line from head to foot, the same throughout: standing, walking, lying; neither sitting nor
// rolling.
bool Stance::stretched() const {
  return length(mean_trunk()) > 0.8 && length(mean_legs()) > 0.7 &&
         dot(unit(mean_trunk()), unit(mean_legs())) < -0.7;
}

// Moves across the axis, and not along it.
bool Stance::walks_across(const Vec3& axis, double leg) const {
  const Vec3 way = most_ - least_;
  double along = 0;
  for (int i = 0; i < 3; ++i) along += std::abs(way[i] * axis[i]);
  const double across = std::sqrt(std::max(0.0, dot(way, way) - along * along));
  return across > 0.4 * leg && along < 0.5 * across;
}

std::optional<ClipUp> Stance::other_up(ClipUp usual, double leg, bool neutral_stands) const {
  const Vec3 trunk = mean_trunk();
  if (rotated(world_from_clip(usual), trunk).y > 0.5 || !stretched()) return std::nullopt;
  for (const ClipUp up :
       {ClipUp::kY, ClipUp::kZ, ClipUp::kX, ClipUp::kMinusY, ClipUp::kMinusZ, ClipUp::kMinusX}) {
    if (rotated(world_from_clip(up), trunk).y < 0.8) continue;
    if (neutral_stands && !walks_across(trunk, leg)) return std::nullopt;
    return up;
  }
  return std::nullopt;
}

std::string Stance::lies(const Quat& world_up, double leg) const {
  const double upright = rotated(world_up, mean_trunk()).y;
  if (upright > 0.5 || !stretched() || !walks_across(unit(mean_trunk()), leg)) return "";
  return std::string("the person ") + (upright < -0.5 ? "hangs upside down" : "lies") +
         " while it walks (--up says which axis points up)";
}

std::string Stance::too_fast(double scale, double seconds) const {
  const double way = scale * length(most_ - least_);
  if (seconds < 0.5 || way < kMostSpeed_m_s * seconds) return "";
  return "the hips are " + two_digits(way) + " m away within " + two_digits(seconds) + " s";
}

std::string BoneRatios::text() const {
  return "bones " + two_digits(least) + " (" + bone_name(least_joint) + ") to " + two_digits(most) +
         " (" + bone_name(most_joint) + ") of the body's";
}

std::string BoneRatios::unsound() const {
  if (least >= kLeastRatio && most <= kMostRatio) return "";
  const bool is_short = least < kLeastRatio;
  return std::string("the ") + bone_name(is_short ? least_joint : most_joint) + " is " +
         two_digits(is_short ? least : most) +
         " times as long as the body's where the legs are as long";
}

BoneRatios bone_ratios(const JointPlaces& places, double scale, const figurine::Body& body) {
  JointPlaces own;
  for (uint32_t j = 0; j < kJointCount; ++j) own[j] = joint_place(body, static_cast<int>(j));
  BoneRatios ratios;
  ratios.least = 1e30;
  ratios.most = 0;
  for (size_t b = 0; b <= kBoneCount; ++b) {
    const double ratio = scale * bone_length(places, b) / bone_length(own, b);
    if (ratio < ratios.least) ratios.least = ratio, ratios.least_joint = bone_joint(b);
    if (ratio > ratios.most) ratios.most = ratio, ratios.most_joint = bone_joint(b);
  }
  return ratios;
}

void BoneStretch::add(const JointPlaces& places) {
  for (size_t b = 0; b <= kBoneCount; ++b) {
    const double value = bone_length(places, b);
    least_[b] = any_ ? std::min(least_[b], value) : value;
    most_[b] = any_ ? std::max(most_[b], value) : value;
  }
  any_ = true;
}

std::string BoneStretch::unsound() const {
  for (size_t b = 0; any_ && b < kBoneCount; ++b) {  // a spine bends
    if (most_[b] > kMostStretch * least_[b]) {
      return std::string("the ") + bone_name(bone_joint(b)) + " changes its length from " +
             two_digits(least_[b]) + " to " + two_digits(most_[b]);
    }
  }
  return "";
}

}  // namespace figurine::ports
