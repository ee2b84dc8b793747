// Pictures of a trained avatar and of its person, and the boxes in them that metrics and contact
// sheets look at.
#pragma once

#include <cstdint>
#include <span>

#include "toolchain/measure/metrics.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::pictures {

// One captured frame, decoded for all its cameras.
struct PosedFrame {
  train::PosedBody posed;
  torch::Tensor head;
};
PosedFrame pose_frame(train::TrainedAvatar& avatar, size_t frame);
measure::Picture render_picture(train::TrainedAvatar& avatar, const PosedFrame& posed,
                                const Camera& camera);
measure::Picture true_picture(const dataset::Dataset& data, size_t frame, size_t camera);

// The bounding box of the texels that `joints` move most, in the image; enlarged by a share of its
// sides. Empty if they are behind the camera or outside.
measure::Box projected_box(const train::AvatarModel& model, const train::PosedBody& posed,
                           const Camera& camera, std::span<const uint8_t> joints, float enlarge);

// Joints of SMPL-X.
std::span<const uint8_t> head_joints();
std::span<const uint8_t> left_hand_joints();

}  // namespace figurine::pictures
