// A T-pose told by the axes of bones, for one rig: the emotes of the npm package
// @dcl/wearable-preview 1.28.1 (Decentraland, Apache-2.0), the only one whose axes are known here.
//
// Those files hold no rest pose: their nodes and, where there is a skin, its inverse bind matrices
// stand in a frame of the animation. What they do fix is where the axes of every joint lie in its
// bone, measured over all 16 clips: y runs along the bone (the next joint lies there in every
// frame), elbows turn about x only one way, knees too, fingers close about z from 0 to 94 degrees
// and hardly open beyond. A foot at rest on the floor points 26 degrees down, from ankle to ball
// (the idle, dance and jump clips).
#pragma once

#include <optional>
#include <string>

#include "ports/motion/clip_tree.h"

namespace figurine::ports {

// How a joint of the known rig is turned in the T-pose: a person upright who faces +z, arms along
// x, palms down. None for jaw and eyes, which it does not have.
std::optional<Quat> neutral_axes(int joint);

// Why a pose of a file is not one of the known rig, in words; empty if it is.
std::string not_the_known_rig(const ClipTree& tree, const JointNodes& joints,
                              const WorldPose& pose);

// The joint at the far end of a limb's or finger's bone; -1: none.
int bone_end_of(int joint);

}  // namespace figurine::ports
