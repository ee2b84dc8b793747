// One person's model as the trainer holds it: a pose goes in, the UNet's input and the skinning
// transforms come out; from the UNet's output and the static values, Gaussians and pictures. The
// trainer, the evaluation, the golden frame and the parity check all go through here, so they
// cannot differ.
#pragma once

#include <array>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/model/compose.h"
#include "toolchain/model/render.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor.h"
#include "toolchain/train/grid_body.h"
#include "toolchain/train/owned_pose.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/settings.h"
#include "toolchain/train/smallest_extent.h"
#include "toolchain/train/static_map.h"

namespace figurine::train {

// What a pose becomes before any network.
struct PosedBody {
  torch::Tensor input;  // [T_n,T_n,Cin] float: standardised maps, Fourier channels behind them;
                        // undefined without a network
  std::vector<Affine>
      world_from_rest;  // [J] skinning transforms of the template that the Gaussians sit on
};

// dL/d of what is learned, from one head's.
struct PartGradients {
  torch::Tensor network;  // [T_n,T_n,C] of its output; undefined without a network
  torch::Tensor statics;  // [P]; undefined without static values
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
  bool has_network() const { return unet_ != nullptr; }
  // Throws InputError if there is no network.
  model::PoseUNet& unet() { return *checked_unet(); }
  const model::PoseUNet& unet() const { return *checked_unet(); }
  StaticMap& statics() { return statics_; }
  const StaticMap& statics() const { return statics_; }
  // Filled by whoever trains or opens a run; null where the settings want none.
  SmallestExtentMap* smallest_extents() { return extents_.get(); }
  const SmallestExtentMap* smallest_extents() const { return extents_.get(); }
  // All of them, for files.
  LearnedParts parts() {
    return {.unet = unet_.get(), .statics = &statics_, .extents = extents_.get()};
  }
  // From now on all are the other's, in the same memory.
  void share_parts(const AvatarModel& other);
  model::AvatarRenderer& renderer() { return renderer_; }

  // The pose that puts this model's root where the captured person's root was. The two differ by
  // the rest positions of the mean and of the person's own root, and only for the mean template.
  OwnedPose from_capture(const dataset::CaptureFrame& frame) const;

  // May be called from several threads.
  PosedBody pose(const PoseView& pose) const;

  // Borrows `posed`.
  model::HeadFrame head_frame(const PosedBody& posed) const;

  // [N,C] raw head from the network's output [T_n,T_n,C] (undefined without a network) and the
  // static values, without gradient; and the gradient back from dL/dhead.
  torch::Tensor compose(const torch::Tensor& output) const;
  PartGradients compose_backward(const torch::Tensor& output,
                                 const torch::Tensor& head_gradient) const;

  // [N,C] raw head without gradient.
  torch::Tensor evaluate(const PosedBody& posed);

  // [4,H,W] premultiplied colour and alpha of the whole image, without gradient.
  torch::Tensor render(const torch::Tensor& head, const PosedBody& posed, const Camera& camera);
  // [H,W,4], the same.
  std::vector<float> render_rgba(const torch::Tensor& head, const PosedBody& posed,
                                 const Camera& camera);

 private:
  model::PoseUNet* checked_unet() const;
  torch::Tensor draw_input(const PoseView& pose, uint32_t channels,
                           std::span<Affine> scratch) const;

  const Body& body_;
  TrainSettings settings_;
  std::vector<float> shape_;
  std::vector<float> joint_position_m_;  // [J,3] of the template that the Gaussians sit on
  std::vector<float> texel_position_m_;  // [N,3]
  std::array<float, 3> root_offset_m_{0, 0, 0};
  model::HeadComposer composer_;
  GridBody grid_body_;                     // of the network
  std::vector<float> constant_input_;      // [T_n,T_n,Cin] zeros and Fourier channels
  std::unique_ptr<model::PoseUNet> unet_;  // null without a network
  StaticMap statics_;
  std::shared_ptr<SmallestExtentMap> extents_;
  model::AvatarRenderer renderer_;
};

// Sizes for reports: {"network": {...}, "static": {...}} with values and bytes of each part.
nlohmann::json describe_parts(const AvatarModel& model);

}  // namespace figurine::train
