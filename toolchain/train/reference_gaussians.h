// The warm-up's target: Gaussians that stand on the template, as large as the texel spacing,
// coloured from the images. Optional; off by default, because it gains nothing here: offsets start
// at zero, scales at the texel spacing and colours at grey anyway (docs/training.md has the
// measurement).
//
// A texel's colour is the mean over some training images in which its normal faces the camera and
// its pixel belongs to the person. Texels behind another limb take a wrong colour from such an
// image; the mean bears it. Based on: Pang et al., ASH, 2024 (warm-up by MSE to reference
// Gaussians; theirs takes colours from a texture and rotations from the normals, ours start
// isotropic, so the rotation is the identity).
#pragma once

#include "toolchain/dataset/dataset.h"
#include "toolchain/tensor.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::train {

// [N,C] raw head outputs of the reference Gaussians.
torch::Tensor reference_head(const dataset::Dataset& data, const AvatarModel& model);

// Mean squared difference, differentiable by head.
torch::Tensor reference_loss(const torch::Tensor& head, const torch::Tensor& reference);

}  // namespace figurine::train
