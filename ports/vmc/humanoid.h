// The humanoid bones of VRM (Unity's HumanBodyBones) on the joints of a body.
//
// A sender's model stands, with all of its bones unturned, in VRM's T-pose: arms along the sides'
// axis, palms down, thumbs forward and out by 45 degrees, legs straight down, feet forward; its
// bones' own axes are the model's (a normalised model, as VMC's senders have it). So the rotation
// of a bone in the model's space, the product of the local ones from the hips down, says how the
// bone is turned away from the T-pose, W. A body's rest pose is another one (arms that hang): A
// turns each of its joints from rest into the T-pose, and
//   R_joint = W_bone A_joint,   Q_joint = R_parent^-1 R_joint,
// the second by the body's own tree. Trunk, head, eyes and jaw stand upright in both: A = 1. Limbs:
// the smallest rotation that lays the bone where the T-pose has it, joint by joint, so that elbows
// and knees keep their hinges, A = minimal(A_parent bone, T-pose's) A_parent. Feet: about the
// vertical alone, so that soles stay flat. A joint that has no bone goes with its parent; bones
// that a body has no joint for turn what hangs on them all the same.
//
// Unity's axes are left-handed: x to the right, y up, z forward, the figure faces +z and its left
// hand is at -x. Ours are right-handed, with the left hand at +x: M = diag(-1, 1, 1) takes one into
// the other, so (x, y, z) -> (-x, y, z), and a rotation R becomes M R M: the quaternion
// (w, x, y, z) -> (w, x, -y, -z).
//
// Based on: VRM specification 0.0 and 1.0 (bones, T-pose); VirtualMotionCapture protocol.
#pragma once

#include <array>
#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/pose.h"
#include "figurine/status.h"

namespace figurine::ports {

inline constexpr size_t kHumanoidBones = 55;
// A place from outside that is further from the origin is not believed.
inline constexpr double kFarthestPlace_m = 1000;

// Its number, by Unity's name ("LeftUpperArm") whatever its case; none for other names.
std::optional<size_t> humanoid_bone(std::string_view name);
const char* humanoid_bone_name(size_t bone);
// The bone that it hangs on; -1 of the hips, number 0.
int humanoid_parent(size_t bone);

// In our axes from Unity's, and the other way: each is its own inverse.
inline glm::dvec3 mirror(const glm::dvec3& v) { return {-v.x, v.y, v.z}; }
inline glm::dquat mirror(const glm::dquat& q) { return {q.w, q.x, -q.y, -q.z}; }

// What a sender says of a model, in our axes.
struct HumanoidPose {
  std::array<glm::dquat, kHumanoidBones> local;     // unit; of each bone on its parent
  std::array<glm::dvec3, kHumanoidBones> offset_m;  // its place on its parent
  std::array<bool, kHumanoidBones> has_offset{};
  glm::dquat root{1, 0, 0, 0};  // of the model in the world
  glm::dvec3 root_m{0, 0, 0};

  HumanoidPose() {
    local.fill(glm::dquat(1, 0, 0, 0));
    offset_m.fill(glm::dvec3(0));
  }
};

class HumanoidRig {
 public:
  // rest_position_m: [J,3]. kUnsupported, naming the joint, for a body without the joints of hips,
  // legs, arms and head under SMPL-X's names; everything else may be missing.
  static Result<HumanoidRig> create(std::span<const std::string> joint_names,
                                    const SkeletonView& rest);

  size_t joint_count() const { return parents_.size(); }
  // The bone of a joint; -1: none.
  int bone_of(size_t joint) const { return bone_of_[joint]; }

  // The body's pose of a sender's. rotations: [J,4] wxyz. The root follows the hips, scaled by the
  // lengths of the legs, which the bones' offsets say; where they do not, or it would be beyond
  // belief, it stays in its place. Allocates nothing.
  void to_body(const HumanoidPose& pose, std::span<float> rotations,
               std::array<float, 3>& root_translation_m) const;

  // What a sender whose model has this body's proportions would say: the inverse.
  HumanoidPose from_body(const PoseView& pose) const;

 private:
  HumanoidRig() = default;

  std::vector<int> parents_, bone_of_;  // [J]
  std::array<int, kHumanoidBones> joint_of_{};
  std::vector<glm::dquat> align_;  // [J] A
  std::vector<glm::dvec3> rest_;   // [J]
  double leg_m_ = 0;               // thigh and shank
};

}  // namespace figurine::ports
