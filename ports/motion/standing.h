// How a person stands in a clip: whether a pose is a T-pose, which axis points up, and what no
// person can do. Told by the places of the joints alone, whatever the file says of itself.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "figurine/body.h"
#include "ports/motion/retarget.h"
#include "ports/motion/rotation.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {

using JointPlaces = std::array<Vec3, kJointCount>;  // in the file's axes and unit

// Turns a pose until it stands upright and faces +z, by hips and shoulders: in whole right angles
// where that is near enough, because templates stand a little askew.
Quat upright_by_itself(const JointPlaces& places);
// The same about the vertical alone, behind a rotation that stands the world upright.
Quat facing_forward(const JointPlaces& places, const Quat& world_up);

// Why a pose is no T-pose once it is turned like that, in words; empty if it is one. most_drop_deg:
// how far arms may hang below the horizontal (kTPose, or kAPose where the pose is a template's).
inline constexpr double kTPoseDrop = 30, kAPoseDrop = 65;
std::string no_t_pose(const JointPlaces& places, const std::array<bool, kJointCount>& known,
                      const Quat& upright, double most_drop_deg);

// Seen over the frames of a clip, in the file's axes.
class Stance {
 public:
  void add(const JointPlaces& places);
  // trunk: from hips to shoulders, legs: from hips to ankles; unit vectors.
  void add(const Vec3& trunk, const Vec3& legs, const Vec3& hips);

  // The axis along which a person stands upright throughout, if it is not the usual one; none where
  // the usual one holds or nothing is clear. neutral_stands: a T-pose of the file stands along the
  // usual one, so that a person who keeps still may well lie.
  std::optional<ClipUp> other_up(ClipUp usual, double leg, bool neutral_stands) const;
  // Lies or hangs while it walks, in words; empty if it does not.
  std::string lies(const Quat& world_up, double leg) const;
  // Is elsewhere sooner than anybody runs, in words; empty if not. scale: of the file's unit to
  // metres.
  std::string too_fast(double scale, double seconds) const;

 private:
  Vec3 mean_trunk() const;
  Vec3 mean_legs() const;
  bool stretched() const;
  bool walks_across(const Vec3& axis, double leg) const;

  Vec3 trunk_{0, 0, 0}, legs_{0, 0, 0};  // sums
  Vec3 least_{0, 0, 0}, most_{0, 0, 0};  // of the hips
  uint32_t count_ = 0;
};

// Lengths of limbs and trunk against the body's, once scaled by the legs.
struct BoneRatios {
  double least = 1, most = 1;
  int least_joint = kLeftHip, most_joint = kLeftHip;  // where the bone begins
  std::string text() const;
  // What no person's proportions are, in words; empty if they may be.
  std::string unsound() const;
};
BoneRatios bone_ratios(const JointPlaces& places, double scale, const figurine::Body& body);

// How much bones change their length within a clip.
class BoneStretch {
 public:
  void add(const JointPlaces& places);
  std::string unsound() const;

 private:
  std::array<double, 9> least_{}, most_{};
  bool any_ = false;
};

}  // namespace figurine::ports
