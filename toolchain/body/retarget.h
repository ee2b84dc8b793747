// Moves captured motion onto a body: BVH (CMU's joint names), SMPL-X parameters (AMASS-style .npz)
// and glTF (.glb, HumanIK's joint names), rest poses aligned.
//
// Idea: what carries over is how each bone is turned in the world relative to the source's neutral
// pose. Where the body's rest pose differs from that neutral pose (arms that hang, bent elbows),
// the body's bone is first turned onto the source's neutral direction by the smallest rotation,
// joint by joint down the limb, so that elbows and knees keep their hinges:  R_body(t) =
// R_source(t) R_source(neutral)^T A,   A = minimal(A_parent d, d_source) A_parent. The trunk and
// the head stand upright in both, so A is the identity there, and the feet are only turned about
// the vertical: soles stay flat. The root's path is scaled by leg length; the lowest sole touches y
// = 0. Fingers that the source has are aligned like limbs, those that it does not have are curled
// as a hand at rest. Based on: Gleicher, Retargetting Motion to New Characters, 1998 (the problem
// and its constraints; no space-time optimisation is done here).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "figurine/body.h"
#include "toolchain/body/bvh.h"
#include "toolchain/body/motion_clip.h"

namespace figurine::body {

enum class Neutral : uint8_t {
  kFirstFrame,  // frame 0 stands in a T-pose (the CMU conversions)
  kZeroPose,  // BVH: the hierarchy itself, all rotations zero, is the T-pose; glTF: the nodes' own
              // transforms are
  kBoneAxes,  // glTF: the file holds no T-pose, but its joints' axes lie in the bones as in the rig
              // that retarget_glb.cpp describes
};

inline constexpr float kCaptureSmoothS = 0.03f;

struct RetargetOptions {
  float frames_per_second = 30;
  std::optional<uint32_t> start;   // first source frame (glTF: at the result's rate); default: 1
                                   // after a neutral first frame, else 0
  std::optional<uint32_t> frames;  // of the result; default: to the end
  std::optional<Neutral> neutral;  // default: the first frame of a BVH, the bone axes of a glTF
  // Standard deviation of a Gaussian over time that takes the capture's jitter out; 0: none.
  // Default: kCaptureSmoothS, and none for glTF, whose keys an animator or a tool has cleaned.
  std::optional<float> smooth_s;
  bool z_up = true;        // .npz: the world's up axis is z (AMASS); BVH and glTF files are y-up
  uint32_t animation = 0;  // glTF: which of the file's animations
  std::string name;
};

// What a retargeted clip is like: figures that tell a good one from a broken one.
struct RetargetReport {
  float scale = 1;             // source units to the body's metres
  float lowest_sole_m = 0;     // of all frames, after grounding
  float mean_contact_m = 0;    // mean over frames of |height of the lowest sole|
  float largest_step_rad = 0;  // largest rotation of a joint between neighbouring frames
};

// InputError naming file, joint and reason: unknown joint names, a start beyond the end, ...
MotionClip retarget_bvh(const Bvh& bvh, const figurine::Body& body, const RetargetOptions& options,
                        RetargetReport* report = nullptr);

// AMASS-style: poses [F,165] axis-angle (or [F,156] without face, [F,66] body only), trans [F,3],
// mocap_frame_rate or mocap_framerate.
MotionClip retarget_npz(const std::string& path, const figurine::Body& body,
                        const RetargetOptions& options, RetargetReport* report = nullptr);

// glTF binary: see gltf.h for what is read. Sampled at the result's rate from the first key to the
// last.
MotionClip retarget_glb(const std::string& path, const figurine::Body& body,
                        const RetargetOptions& options, RetargetReport* report = nullptr);

}  // namespace figurine::body
