// Motions as parameters of SMPL, SMPL-H or SMPL-X in .npz: AMASS in all its releases, and what
// tools that see people in videos write.
//
// One array of rotations (poses, pose, fullpose, smpl_poses: [F,66 | 72 | 156 | 165], [F,J,3] or
// matrices [F,J,3,3]), or one a part (root_orient or global_orient; pose_body or body_pose;
// pose_hand, left_hand_pose, right_hand_pose; pose_jaw, pose_eye, ...). Places: trans, transl or
// smpl_trans [F,3]. Any type of number, a first extent of 1 is passed over. Hands as coefficients
// of a basis are left at rest, and said.
#pragma once

#include <span>
#include <string>

#include "figurine/body.h"
#include "ports/motion/retarget.h"

namespace figurine::ports {

// kCorrupt or kUnsupported naming file, array and reason; kInvalidArgument where the rate is
// missing.
Result<MotionClip> retarget_smpl(std::span<const std::byte> bytes, const std::string& where,
                                 const figurine::Body& body, const RetargetOptions& options,
                                 RetargetReport* report);

}  // namespace figurine::ports
