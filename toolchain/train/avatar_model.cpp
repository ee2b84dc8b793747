#include "toolchain/train/avatar_model.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "toolchain/error.h"
#include "toolchain/model/network_adapter.h"
#include "toolchain/tensor_operations.h"

namespace figurine::train {

namespace {

// Everything else stands on it.
const Body& checked_body(const Body& body, const TrainSettings& settings) {
  const uint32_t side = texel_side(settings);
  if (body.uv_size != side) {
    throw InputError("body " + body.name + ": has T = " + std::to_string(body.uv_size) +
                     ", preset " + settings.preset + " needs " + std::to_string(side) +
                     " (figurine-train body --uv)");
  }
  return body;
}

}  // namespace

AvatarModel::AvatarModel(const Body& body, std::vector<float> shape, const TrainSettings& settings,
                         bool bf16)
    : body_(checked_body(body, settings)),
      settings_(settings),
      shape_(settings.template_mode == TemplateMode::kShaped ? shape : std::vector<float>{}),
      joint_position_m_(body.joint_position_m.size()),
      texel_position_m_(body.texel_position_m.size()),
      composer_(body, head_layout(settings)),
      grid_body_(body, settings.network ? network_side(settings) : body.uv_size),
      statics_(composer_),
      extents_(settings.smallest_extent ? std::make_shared<SmallestExtentMap>(body.texel_count())
                                        : nullptr),
      renderer_({.threads = settings.threads, .antialiased = settings.antialiased}) {
  if (shape.size() > body.shape_count()) {
    throw InputError("body " + body.name + ": has " + std::to_string(body.shape_count()) +
                     " shape coefficients, the person " + std::to_string(shape.size()));
  }
  if (settings.template_mode == TemplateMode::kMean) {
    std::vector<float> joints(joint_position_m_.size()), texels(texel_position_m_.size());
    shape_body(body, shape, joints, texels);
    for (int k = 0; k < 3; ++k) root_offset_m_[k] = joints[k] - body.joint_position_m[k];
  }
  shape_body(body, shape_, joint_position_m_, texel_position_m_);
  if (!settings.network) return;
  unet_ = std::make_unique<model::PoseUNet>(
      make_network(settings), model::PoseUNetOptions{.precision = bf16 ? model::Precision::kBfloat16
                                                                       : model::Precision::kFloat32,
                                                     .seed = kInitialWeightsSeed});
  const uint32_t size = network_side(settings), channels = input_channels(settings);
  constant_input_.assign(size_t(size) * size * channels, 0.0f);
  if (settings.fourier_octaves > 0)
    draw_fourier_channels(size, settings.fourier_octaves, kMapChannels, channels, constant_input_);
}

model::PoseUNet* AvatarModel::checked_unet() const {
  if (unet_ == nullptr) throw InputError("the avatar has no network");
  return unet_.get();
}

void AvatarModel::share_parts(const AvatarModel& other) {
  if (has_network()) unet_->share_weights(*other.unet_);
  statics_ = other.statics_;
  extents_ = other.extents_;
}

OwnedPose AvatarModel::from_capture(const dataset::CaptureFrame& frame) const {
  OwnedPose pose{frame.root_translation_m, frame.rotations};
  for (int k = 0; k < 3; ++k) pose.root_translation_m[k] += root_offset_m_[k];
  return pose;
}

PosedBody AvatarModel::pose(const PoseView& pose) const {
  const uint32_t joints = body_.joint_count(), channels = input_channels(settings_);
  throw_if_error(validate_pose(pose, joints), body_.name);
  PosedBody posed{{}, std::vector<Affine>(joints)};
  if (has_network()) posed.input = draw_input(pose, channels, posed.world_from_rest);
  skinning_transforms({body_.parents, joint_position_m_}, pose, posed.world_from_rest);
  return posed;
}

torch::Tensor AvatarModel::draw_input(const PoseView& pose, uint32_t channels,
                                      std::span<Affine> scratch) const {
  const int64_t size = grid_body_.view().uv_size;
  torch::Tensor drawn = torch::empty({size, size, int64_t(channels)});
  float* input = drawn.data_ptr<float>();
  std::memcpy(input, constant_input_.data(), constant_input_.size() * sizeof(float));
  PoseView seen = pose;
  std::vector<float> frozen;
  if (settings_.freeze_pose) {
    frozen.resize(pose.rotations.size());
    for (size_t j = 0; j < frozen.size(); j += 4) frozen[j] = 1;
    std::copy_n(pose.rotations.begin(), 4, frozen.begin());
    seen.rotations = frozen;
    seen.root_translation_m = {0, 0, 0};  // the maps leave it out; so do their last bits now
  }
  draw_pose_maps(grid_body_.view(), seen, MapStatistics{}, scratch, channels,
                 {input, constant_input_.size()});
  return drawn;
}

model::HeadFrame AvatarModel::head_frame(const PosedBody& posed) const {
  return {.body = &body_,
          .texel_position_m = texel_position_m_,
          .world_from_rest = posed.world_from_rest,
          .decoding = settings_.decoding,
          .smallest_extent_m =
              extents_ == nullptr ? std::span<const float>{} : std::span(extents_->extent_m())};
}

torch::Tensor AvatarModel::evaluate(const PosedBody& posed) {
  torch::NoGradGuard no_gradient;
  return compose(has_network() ? unet_->forward(posed.input) : torch::Tensor());
}

torch::Tensor AvatarModel::compose(const torch::Tensor& output) const {
  torch::Tensor head =
      torch::empty({int64_t(composer_.texel_count()), int64_t(composer_.layout().channels)});
  composer_.forward(has_network() ? output.const_data_ptr<float>() : nullptr,
                    statics_.values.const_data_ptr<float>(), settings_.threads,
                    head.mutable_data_ptr<float>());
  return head;
}

PartGradients AvatarModel::compose_backward(const torch::Tensor& output,
                                            const torch::Tensor& head_gradient) const {
  torch::NoGradGuard no_gradient;
  PartGradients gradients;
  if (has_network()) gradients.network = torch::empty_like(output);
  if (!statics_.empty()) gradients.statics = torch::empty_like(statics_.values);
  composer_.backward(has_network() ? output.const_data_ptr<float>() : nullptr,
                     statics_.values.const_data_ptr<float>(), head_gradient.const_data_ptr<float>(),
                     settings_.threads,
                     has_network() ? gradients.network.mutable_data_ptr<float>() : nullptr,
                     statics_.empty() ? nullptr : gradients.statics.mutable_data_ptr<float>());
  return gradients;
}

torch::Tensor AvatarModel::render(const torch::Tensor& head, const PosedBody& posed,
                                  const Camera& camera) {
  torch::NoGradGuard no_gradient;
  return renderer_.render(head, head_frame(posed),
                          {.camera = camera, .crop = {0, 0, camera.width_px, camera.height_px}});
}

std::vector<float> AvatarModel::render_rgba(const torch::Tensor& head, const PosedBody& posed,
                                            const Camera& camera) {
  const torch::Tensor image = render(head, posed, camera).permute({1, 2, 0}).contiguous();
  const float* data = image.data_ptr<float>();
  return {data, data + image.numel()};
}

nlohmann::json describe_parts(const AvatarModel& model) {
  const TrainSettings& settings = model.settings();
  nlohmann::json network = nullptr, statics = nullptr;
  if (model.has_network()) {
    const Network layers = make_network(settings);
    uint64_t outputs = 0;
    for (const Layer& layer : layers.layers) outputs += layer.out_channels;
    const uint64_t parameters = model.unet().parameter_count();
    // In fixed point a weight is a byte; every output has a bias and a scale of four bytes.
    network = {{"size", network_side(settings)},
               {"channels", network_channels(settings)},
               {"parameters", parameters},
               {"macs", count_macs(layers, value_or_throw(infer_shapes(layers, false), "network"))},
               {"bytes_f32", 4 * parameters},
               {"bytes_q8", parameters - outputs + 8 * outputs}};
    if (const uint32_t rank = settings.adapter.rank; rank > 0) {
      network["adapter"] = {{"kind", to_string(settings.adapter.kind)},
                            {"rank", rank},
                            {"values", factor_count(model.unet(), settings.adapter.kind, rank)}};
    }
  }
  if (!model.statics().empty()) {
    uint64_t channels = 0;
    for (const auto& [cells, count] : model.statics().shapes)
      channels += static_cast<uint64_t>(count);
    const auto values = static_cast<uint64_t>(model.statics().values.numel());
    statics = {{"grids", to_string(settings.static_grids)},
               {"values", values},
               {"bytes", values + 4 * channels}};
  }
  nlohmann::json extents = nullptr;
  if (const SmallestExtentMap* map = model.smallest_extents(); map != nullptr && !map->empty()) {
    const auto [least, most] = std::minmax_element(map->extent_m().begin(), map->extent_m().end());
    extents = {{"bytes", map->texels()}, {"min_m", *least}, {"max_m", *most}};
  }
  return {{"network", network}, {"static", statics}, {"smallest_extent", extents}};
}

}  // namespace figurine::train
