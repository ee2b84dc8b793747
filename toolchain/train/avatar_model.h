// One person's model as the trainer holds it: a pose goes in, the UNet's input and the skinning
// transforms come out; from the UNet's output, Gaussians and pictures. The trainer, the evaluation,
// the golden frame and the parity check all go through here, so they cannot differ.
#pragma once

#include <array>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/model/render.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor.h"
#include "toolchain/train/owned_pose.h"
#include "toolchain/train/settings.h"

namespace figurine::train {

// What a pose becomes before any network.
struct PosedBody {
  torch::Tensor input;  // [T,T,Cin] float: standardised maps, Fourier channels behind them
  std::vector<Affine>
      world_from_rest;  // [J] skinning transforms of the template that the Gaussians sit on
};

class AvatarModel {
 public:
  // body is borrowed. Throws InputError if it does not fit the settings: another T, fewer shape
  // coefficients than the person has.
  AvatarModel(const Body& body, std::vector<float> shape, const TrainSettings& settings, bool bf16);

  const Body& body() const { return body_; }
  const TrainSettings& settings() const { return settings_; }
  // Empty for the mean template.
  const std::vector<float>& shape() const { return shape_; }
  model::PoseUNet& unet() { return unet_; }
  const model::PoseUNet& unet() const { return unet_; }
  model::AvatarRenderer& renderer() { return renderer_; }

  // The pose that puts this model's root where the captured person's root was. The two differ by
  // the rest positions of the mean and of the person's own root, and only for the mean template.
  OwnedPose from_capture(const dataset::CaptureFrame& frame) const;

  // May be called from several threads.
  PosedBody pose(const PoseView& pose) const;

  // Borrows `posed`.
  model::HeadFrame head_frame(const PosedBody& posed) const;

  // [T,T,C] raw head output without gradient.
  torch::Tensor evaluate(const PosedBody& posed);

  // [4,H,W] premultiplied colour and alpha of the whole image, without gradient.
  torch::Tensor render(const torch::Tensor& head, const PosedBody& posed, const Camera& camera);
  // [H,W,4], the same.
  std::vector<float> render_rgba(const torch::Tensor& head, const PosedBody& posed,
                                 const Camera& camera);

 private:
  const Body& body_;
  TrainSettings settings_;
  std::vector<float> shape_;
  std::vector<float> joint_position_m_;  // [J,3] of the template that the Gaussians sit on
  std::vector<float> texel_position_m_;  // [N,3]
  std::array<float, 3> root_offset_m_{0, 0, 0};
  std::vector<float> constant_input_;  // [T,T,Cin] zeros and Fourier channels
  model::PoseUNet unet_;
  model::AvatarRenderer renderer_;
};

}  // namespace figurine::train
