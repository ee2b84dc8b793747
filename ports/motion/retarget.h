// Moves captured motion onto a body: what the readers of clips hand over, in terms of the 55
// joints, becomes poses of a body whose rest pose is another.
//
// Idea: what carries over is how each bone is turned in the world relative to the source's neutral
// pose. Where the body's rest pose differs from that neutral pose (arms that hang, bent elbows),
// the body's bone is first turned onto the source's neutral direction by the smallest rotation,
// joint by joint down the limb, so that elbows and knees keep their hinges:  R_body(t) =
// R_source(t) R_source(neutral)^T A,   A = minimal(A_parent d, d_source) A_parent. The trunk and
// the head stand upright in both, so A is the identity there, and the feet are only turned about
// the vertical: soles stay flat. The root's path is scaled by leg length; the lowest sole touches y
// = 0. Fingers that the source has are aligned like limbs, those that it does not have are curled
// as a hand at rest. Of the body the package says all that is needed: names, parents and rest
// places of the joints, and its texels for the soles. Based on: Gleicher, Retargetting Motion to
// New Characters, 1998 (the problem and its constraints; no space-time optimisation is done here).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/status.h"
#include "ports/motion/joint_names.h"
#include "ports/motion/motion_clip.h"
#include "ports/motion/rotation.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {

// Which pose of a clip stands in a T-pose.
enum class Neutral : uint8_t {
  kFirstFrame,  // frame 0
  kZeroPose,    // BVH: the hierarchy itself, all rotations zero; glTF: the nodes' own transforms
  kFrame,       // the one that RetargetOptions::neutral_frame counts
  kBoneAxes,    // glTF: none, but its joints' axes lie in the bones as in the rig that bone_axes.h
                // describes
};

// Which axis of a clip's world points up.
enum class ClipUp : uint8_t { kY, kZ, kX, kMinusY, kMinusZ, kMinusX };
const char* to_string(ClipUp up);  // "y", "-z"
Quat world_from_clip(ClipUp up);   // turns that axis onto y
std::optional<ClipUp> parse_up(std::string_view text);

inline constexpr float kCaptureSmoothS = 0.03f;

struct RetargetOptions {
  float frames_per_second = 30;
  std::optional<float> source_fps;  // in place of the file's, or where it says none
  std::optional<uint32_t> start;    // first source frame (glTF: at the result's rate); default: 1
                                    // after a neutral first frame, else 0
  std::optional<uint32_t> frames;   // of the result; default: to the end
  // Default: BVH the first frame if it is a T-pose, else the zero pose if that is one; glTF the
  // bone axes if they are the known rig's, else the zero pose, else the first frame, if they are
  // T-poses; VRM's animations and models the zero pose.
  std::optional<Neutral> neutral;
  uint32_t neutral_frame = 0;  // of the clip (glTF: at the result's rate)
  // Standard deviation of a Gaussian over time that takes the capture's jitter out; 0: none.
  // Default: kCaptureSmoothS, and none for glTF, whose keys an animator or a tool has cleaned.
  std::optional<float> smooth_s;
  // Default: y for BVH and glTF, z for .npz (AMASS), or the axis along which the person stands.
  std::optional<ClipUp> up;
  std::optional<uint32_t> animation;  // glTF; default: the first that moves the skeleton
  JointMap map;                       // joints by the names of their nodes
  bool checked = true;                // refuse what cannot be a person
  std::string name;
};

// What a retargeted clip is like: figures that tell a good one from a broken one.
struct RetargetReport {
  float scale = 1;             // source units to the body's metres
  float lowest_sole_m = 0;     // of all frames, after grounding
  float mean_contact_m = 0;    // mean over frames of |height of the lowest sole|
  float largest_step_rad = 0;  // largest rotation of a joint between neighbouring frames
  uint32_t animation = 0;      // glTF: that was read
  std::string summary;         // one line of words: what was read, and how it was taken
};

// What the readers of motion files hand to the retargeting. Internal to ports/motion, as what
// follows is.
struct RetargetSource {
  std::string where;
  double frames_per_second = 0;
  uint32_t frames = 0;
  std::array<bool, kJointCount> driven{};
  std::vector<Quat> world_from_neutral;  // [F,55] R(t) R(neutral)^T; only driven joints are read
  std::vector<Vec3> hips;                // [F] middle of the hip joints, y up, in the file's unit
  std::array<Vec3, kJointCount>
      direction;   // bones of limbs and fingers in the neutral pose; zero: not known
  double leg = 0;  // thigh + shin, in the file's unit
  double tolerance_rad =
      0;  // arms that lie nearer than this to the neutral direction are taken as they are
  float smooth_s = 0;  // where the options do not say

  RetargetSource() { direction.fill(Vec3(0)); }
};

// Errors name the source: a start beyond the end, more frames than there are; kMismatch for a body
// of other joints than the 55 of SMPL-X.
Result<MotionClip> retarget(RetargetSource source, const figurine::Body& body,
                            const RetargetOptions& options, uint32_t start,
                            RetargetReport* report_out);
Status check_body(const figurine::Body& body);

Vec3 joint_place(const figurine::Body& body, int joint);  // at rest, metres
double leg_length_m(const figurine::Body& body);          // thigh + shin, the mean of both sides

}  // namespace figurine::ports
