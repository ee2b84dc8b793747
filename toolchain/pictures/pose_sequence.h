// Sequences of pictures in which shimmer shows: a motion slowed down until neighbouring frames are
// nearly alike, and a person who stands still while the tracker trembles. What is measured is the
// PSNR of the change from frame to frame against another arithmetic's change.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "toolchain/measure/metrics.h"
#include "toolchain/train/owned_pose.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::pictures {

struct PoseSequence {
  std::string name;
  std::vector<train::OwnedPose> poses;
  Camera camera;
};

// `slower` poses for every step between neighbouring key poses: translations linear, rotations by
// normalised linear interpolation (the steps of a motion are small). At least two key poses.
PoseSequence slow_motion(std::span<const train::OwnedPose> keys, uint32_t slower,
                         const Camera& camera);

// `frames` times the same pose with the root moved by up to +-1 mm along every axis and every joint
// turned by 0.05 degrees about a random axis. Deterministic. The network sees the joints' part: its
// maps leave the root's translation out.
PoseSequence trembling_pose(const train::OwnedPose& pose, uint32_t frames, const Camera& camera);

// Premultiplied float RGBA of every pose, [frames] of [H,W,4], by the UNet as it is set. Not
// rounded to 8 bits, whose own noise would end the scale at 53 dB.
using FloatPictures = std::vector<std::vector<float>>;
FloatPictures render_sequence(train::TrainedAvatar& avatar, const PoseSequence& sequence);

// Of prediction's changes against truth's over mid-grey, over pixels whose alpha exceeds 0.5 in
// both true frames.
measure::SquaredError change_error(const FloatPictures& prediction, const FloatPictures& truth);
// The same for a prediction that never changes: what a frozen picture scores.
measure::SquaredError frozen_error(const FloatPictures& truth);

}  // namespace figurine::pictures
