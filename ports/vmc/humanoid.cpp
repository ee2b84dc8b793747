#include "ports/vmc/humanoid.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace figurine::ports {

namespace {

using Quat = glm::dquat;
using Vec3 = glm::dvec3;

// How a bone's A is found.
enum class Align : uint8_t { kUpright, kAlong, kFlat, kWithParent };

struct Bone {
  const char* name;    // Unity's
  const char* parent;  // that every model has, or its own
  const char* joint;   // SMPL-X's
  Align align = Align::kUpright;
  const char* end = nullptr;   // joint at its far end, where it is laid along a direction
  Vec3 direction = {0, 0, 0};  // of the T-pose, in our axes
};

constexpr double kDiagonal = 0.70710678118654752;
constexpr Vec3 kDown{0, -1, 0}, kForward{0, 0, 1}, kLeft{1, 0, 0}, kRight{-1, 0, 0},
    kLeftThumb{kDiagonal, 0, kDiagonal}, kRightThumb{-kDiagonal, 0, kDiagonal};

constexpr Align kUpright = Align::kUpright, kAlong = Align::kAlong, kFlat = Align::kFlat,
                kWithParent = Align::kWithParent;

// Parents before children. The last phalanx has no joint beyond it: it goes with the one before.
constexpr Bone kBones[kHumanoidBones] = {
    {"Hips", "", "pelvis"},
    {"Spine", "Hips", "spine1"},
    {"Chest", "Spine", "spine2"},
    {"UpperChest", "Chest", "spine3"},
    {"Neck", "UpperChest", "neck"},
    {"Head", "Neck", "head"},
    {"LeftEye", "Head", "left_eye"},
    {"RightEye", "Head", "right_eye"},
    {"Jaw", "Head", "jaw"},
    {"LeftUpperLeg", "Hips", "left_hip", kAlong, "left_knee", kDown},
    {"LeftLowerLeg", "LeftUpperLeg", "left_knee", kAlong, "left_ankle", kDown},
    {"LeftFoot", "LeftLowerLeg", "left_ankle", kFlat, "left_foot", kForward},
    {"LeftToes", "LeftFoot", "left_foot", kWithParent},
    {"RightUpperLeg", "Hips", "right_hip", kAlong, "right_knee", kDown},
    {"RightLowerLeg", "RightUpperLeg", "right_knee", kAlong, "right_ankle", kDown},
    {"RightFoot", "RightLowerLeg", "right_ankle", kFlat, "right_foot", kForward},
    {"RightToes", "RightFoot", "right_foot", kWithParent},
    {"LeftShoulder", "UpperChest", "left_collar"},
    {"LeftUpperArm", "LeftShoulder", "left_shoulder", kAlong, "left_elbow", kLeft},
    {"LeftLowerArm", "LeftUpperArm", "left_elbow", kAlong, "left_wrist", kLeft},
    {"LeftHand", "LeftLowerArm", "left_wrist", kAlong, "left_middle1", kLeft},
    {"RightShoulder", "UpperChest", "right_collar"},
    {"RightUpperArm", "RightShoulder", "right_shoulder", kAlong, "right_elbow", kRight},
    {"RightLowerArm", "RightUpperArm", "right_elbow", kAlong, "right_wrist", kRight},
    {"RightHand", "RightLowerArm", "right_wrist", kAlong, "right_middle1", kRight},
    {"LeftThumbProximal", "LeftHand", "left_thumb1", kAlong, "left_thumb2", kLeftThumb},
    {"LeftThumbIntermediate", "LeftThumbProximal", "left_thumb2", kAlong, "left_thumb3",
     kLeftThumb},
    {"LeftThumbDistal", "LeftThumbIntermediate", "left_thumb3", kWithParent},
    {"LeftIndexProximal", "LeftHand", "left_index1", kAlong, "left_index2", kLeft},
    {"LeftIndexIntermediate", "LeftIndexProximal", "left_index2", kAlong, "left_index3", kLeft},
    {"LeftIndexDistal", "LeftIndexIntermediate", "left_index3", kWithParent},
    {"LeftMiddleProximal", "LeftHand", "left_middle1", kAlong, "left_middle2", kLeft},
    {"LeftMiddleIntermediate", "LeftMiddleProximal", "left_middle2", kAlong, "left_middle3", kLeft},
    {"LeftMiddleDistal", "LeftMiddleIntermediate", "left_middle3", kWithParent},
    {"LeftRingProximal", "LeftHand", "left_ring1", kAlong, "left_ring2", kLeft},
    {"LeftRingIntermediate", "LeftRingProximal", "left_ring2", kAlong, "left_ring3", kLeft},
    {"LeftRingDistal", "LeftRingIntermediate", "left_ring3", kWithParent},
    {"LeftLittleProximal", "LeftHand", "left_pinky1", kAlong, "left_pinky2", kLeft},
    {"LeftLittleIntermediate", "LeftLittleProximal", "left_pinky2", kAlong, "left_pinky3", kLeft},
    {"LeftLittleDistal", "LeftLittleIntermediate", "left_pinky3", kWithParent},
    {"RightThumbProximal", "RightHand", "right_thumb1", kAlong, "right_thumb2", kRightThumb},
    {"RightThumbIntermediate", "RightThumbProximal", "right_thumb2", kAlong, "right_thumb3",
     kRightThumb},
    {"RightThumbDistal", "RightThumbIntermediate", "right_thumb3", kWithParent},
    {"RightIndexProximal", "RightHand", "right_index1", kAlong, "right_index2", kRight},
    {"RightIndexIntermediate", "RightIndexProximal", "right_index2", kAlong, "right_index3",
     kRight},
    {"RightIndexDistal", "RightIndexIntermediate", "right_index3", kWithParent},
    {"RightMiddleProximal", "RightHand", "right_middle1", kAlong, "right_middle2", kRight},
    {"RightMiddleIntermediate", "RightMiddleProximal", "right_middle2", kAlong, "right_middle3",
     kRight},
    {"RightMiddleDistal", "RightMiddleIntermediate", "right_middle3", kWithParent},
    {"RightRingProximal", "RightHand", "right_ring1", kAlong, "right_ring2", kRight},
    {"RightRingIntermediate", "RightRingProximal", "right_ring2", kAlong, "right_ring3", kRight},
    {"RightRingDistal", "RightRingIntermediate", "right_ring3", kWithParent},
    {"RightLittleProximal", "RightHand", "right_pinky1", kAlong, "right_pinky2", kRight},
    {"RightLittleIntermediate", "RightLittleProximal", "right_pinky2", kAlong, "right_pinky3",
     kRight},
    {"RightLittleDistal", "RightLittleIntermediate", "right_pinky3", kWithParent},
};

// What the body must have; the rest may be missing.
constexpr std::string_view kNeeded[] = {
    "Hips",          "LeftUpperLeg",  "LeftLowerLeg", "LeftFoot",     "RightUpperLeg",
    "RightLowerLeg", "RightFoot",     "LeftUpperArm", "LeftLowerArm", "LeftHand",
    "RightUpperArm", "RightLowerArm", "RightHand",    "Head"};

constexpr double kLeastScale = 0.05, kMostScale = 20;

bool same_name(std::string_view a, std::string_view b) {
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](char x, char y) { return small(x) == small(y); });
}

size_t bone_number(std::string_view name) { return *humanoid_bone(name); }

const std::array<int, kHumanoidBones>& parents() {
  static const std::array<int, kHumanoidBones> found = [] {
    std::array<int, kHumanoidBones> result{};
    for (size_t b = 0; b < kHumanoidBones; ++b)
      result[b] = b == 0 ? -1 : static_cast<int>(bone_number(kBones[b].parent));
    return result;
  }();
  return found;
}

int joint_number(std::span<const std::string> names, const char* name) {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

// The smallest rotation from one direction to another.
Quat between(const Vec3& from, const Vec3& to) {
  const Vec3 a = glm::normalize(from), b = glm::normalize(to);
  const double cosine = glm::dot(a, b);
  if (cosine < -1 + 1e-12) {  // any axis across will do
    const Vec3 side = std::abs(a.x) < 0.9 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    return glm::angleAxis(3.14159265358979323846, glm::normalize(glm::cross(a, side)));
  }
  const Vec3 axis = glm::cross(a, b);
  return glm::normalize(Quat(1 + cosine, axis.x, axis.y, axis.z));
}

Quat rotation_at(std::span<const float> rotations, size_t joint) {
  const float* q = &rotations[4 * joint];
  return glm::normalize(Quat(q[0], q[1], q[2], q[3]));
}

}  // namespace

std::optional<size_t> humanoid_bone(std::string_view name) {
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    if (same_name(name, kBones[b].name)) return b;
  }
  return std::nullopt;
}

const char* humanoid_bone_name(size_t bone) { return kBones[bone].name; }
int humanoid_parent(size_t bone) { return parents()[bone]; }

Result<HumanoidRig> HumanoidRig::create(std::span<const std::string> joint_names,
                                        const SkeletonView& rest) {
  HumanoidRig rig;
  const size_t count = joint_names.size();
  FIG_CHECK(rest.parents.size() == count && rest.rest_position_m.size() == 3 * count,
            "names, parents and places of the same joints");
  rig.parents_.assign(rest.parents.begin(), rest.parents.end());
  rig.bone_of_.assign(count, -1);
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    const int joint = joint_number(joint_names, kBones[b].joint);
    rig.joint_of_[b] = joint;
    if (joint >= 0) rig.bone_of_[static_cast<size_t>(joint)] = static_cast<int>(b);
    const bool needed =
        std::find(std::begin(kNeeded), std::end(kNeeded), kBones[b].name) != std::end(kNeeded);
    if (joint < 0 && needed) {
      return Status(StatusCode::kUnsupported, std::string("body: has no joint '") +
                                                  kBones[b].joint + "' for the humanoid bone " +
                                                  kBones[b].name);
    }
  }
  for (size_t j = 0; j < count; ++j) {
    const float* p = &rest.rest_position_m[3 * j];
    rig.rest_.emplace_back(p[0], p[1], p[2]);
  }
  const auto place = [&](const char* bone) {
    return rig.rest_[static_cast<size_t>(rig.joint_of_[bone_number(bone)])];
  };
  rig.leg_m_ = glm::distance(place("LeftUpperLeg"), place("LeftLowerLeg")) +
               glm::distance(place("LeftLowerLeg"), place("LeftFoot"));
  rig.align_.assign(count, Quat(1, 0, 0, 0));
  for (size_t j = 0; j < count; ++j) {
    const Quat above = j == 0 ? Quat(1, 0, 0, 0) : rig.align_[static_cast<size_t>(rig.parents_[j])];
    if (rig.bone_of_[j] < 0) {
      rig.align_[j] = above;
      continue;
    }
    const Bone& bone = kBones[rig.bone_of_[j]];
    if (bone.align == Align::kUpright) continue;
    rig.align_[j] = above;
    const int end = bone.end == nullptr ? -1 : joint_number(joint_names, bone.end);
    if (end < 0) continue;
    Vec3 own = rig.rest_[static_cast<size_t>(end)] - rig.rest_[j];
    if (bone.align == Align::kFlat) {
      own.y = 0;
      rig.align_[j] = glm::length(own) > 1e-6 ? between(own, bone.direction) : Quat(1, 0, 0, 0);
    } else if (glm::length(own) > 1e-6) {
      rig.align_[j] = between(above * own, bone.direction) * above;
    }
  }
  return rig;
}

void HumanoidRig::to_body(const HumanoidPose& pose, std::span<float> rotations,
                          std::array<float, 3>& root_translation_m) const {
  FIG_CHECK(rotations.size() == 4 * joint_count(), "a rotation for each joint");
  std::array<Quat, kHumanoidBones> turned;  // W, in the world
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    const int above = parents()[b];
    turned[b] = glm::normalize((above < 0 ? pose.root : turned[static_cast<size_t>(above)]) *
                               pose.local[b]);
  }
  std::array<Quat, kMaxJoints> world;  // R
  for (size_t j = 0; j < joint_count(); ++j) {
    const Quat above = j == 0 ? Quat(1, 0, 0, 0) : world[static_cast<size_t>(parents_[j])];
    world[j] = bone_of_[j] < 0 ? above : turned[static_cast<size_t>(bone_of_[j])] * align_[j];
    const Quat local = glm::normalize(glm::conjugate(above) * world[j]);
    float* q = &rotations[4 * j];
    q[0] = static_cast<float>(local.w), q[1] = static_cast<float>(local.x);
    q[2] = static_cast<float>(local.y), q[3] = static_cast<float>(local.z);
  }

  root_translation_m = {0, 0, 0};
  const size_t knee = bone_number("LeftLowerLeg"), foot = bone_number("LeftFoot");
  if (!pose.has_offset[0] || !pose.has_offset[knee] || !pose.has_offset[foot]) return;
  const double scale =
      leg_m_ / (glm::length(pose.offset_m[knee]) + glm::length(pose.offset_m[foot]));
  if (!(scale >= kLeastScale && scale <= kMostScale)) return;
  const Vec3 place = scale * (pose.root_m + pose.root * pose.offset_m[0]) - rest_[0];
  if (!(glm::length(place) <= kFarthestPlace_m)) return;
  for (int k = 0; k < 3; ++k)
    root_translation_m[static_cast<size_t>(k)] = static_cast<float>(place[k]);
}

HumanoidPose HumanoidRig::from_body(const PoseView& pose) const {
  HumanoidPose result;
  std::vector<Quat> world(joint_count());
  for (size_t j = 0; j < joint_count(); ++j) {
    const Quat local = rotation_at(pose.rotations, j);
    world[j] = j == 0 ? local : glm::normalize(world[static_cast<size_t>(parents_[j])] * local);
  }
  std::array<Quat, kHumanoidBones> turned;
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    const int joint = joint_of_[b], parent = humanoid_parent(b);
    const Quat above = parent < 0 ? Quat(1, 0, 0, 0) : turned[static_cast<size_t>(parent)];
    turned[b] = joint < 0 ? above
                          : world[static_cast<size_t>(joint)] *
                                glm::conjugate(align_[static_cast<size_t>(joint)]);
    result.local[b] = glm::normalize(glm::conjugate(above) * turned[b]);
    if (joint < 0) continue;
    const auto j = static_cast<size_t>(joint);
    result.has_offset[b] = true;
    if (parent < 0) {
      result.offset_m[b] = rest_[0] + Vec3(pose.root_translation_m[0], pose.root_translation_m[1],
                                           pose.root_translation_m[2]);
    } else if (const int on = parents_[j]; on >= 0) {
      // In the T-pose the joint above is turned by its A.
      result.offset_m[b] =
          align_[static_cast<size_t>(on)] * (rest_[j] - rest_[static_cast<size_t>(on)]);
    }
  }
  return result;
}

}  // namespace figurine::ports
