#include "toolchain/train/avatar_model.h"

#include <cstring>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::train {

AvatarModel::AvatarModel(const Body& body, std::vector<float> shape, const TrainSettings& settings,
                         bool bf16)
    : body_(body),
      settings_(settings),
      shape_(settings.template_mode == TemplateMode::kShaped ? shape : std::vector<float>{}),
      joint_position_m_(body.joint_position_m.size()),
      texel_position_m_(body.texel_position_m.size()),
      unet_(make_network(settings),
            {.precision = bf16 ? model::Precision::kBfloat16 : model::Precision::kFloat32,
             .seed = kInitialWeightsSeed}),
      renderer_({.threads = settings.threads}) {
  const Preset& preset = find_preset(settings.preset);
  if (body.uv_size != preset.uv_size) {
    throw InputError("body " + body.name + ": has T = " + std::to_string(body.uv_size) +
                     ", preset " + preset.name + " needs " + std::to_string(preset.uv_size) +
                     " (figurine-train body --uv)");
  }
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
  const uint32_t channels = input_channels(settings);
  constant_input_.assign(size_t(body.uv_size) * body.uv_size * channels, 0.0f);
  if (settings.fourier_octaves > 0)
    draw_fourier_channels(body.uv_size, settings.fourier_octaves, kMapChannels, channels,
                          constant_input_);
}

OwnedPose AvatarModel::from_capture(const dataset::CaptureFrame& frame) const {
  OwnedPose pose{frame.root_translation_m, frame.rotations};
  for (int k = 0; k < 3; ++k) pose.root_translation_m[k] += root_offset_m_[k];
  return pose;
}

PosedBody AvatarModel::pose(const PoseView& pose) const {
  const uint32_t joints = body_.joint_count(), channels = input_channels(settings_);
  throw_if_error(validate_pose(pose, joints), body_.name);
  const int64_t size = body_.uv_size;
  PosedBody posed{torch::empty({size, size, int64_t(channels)}), std::vector<Affine>(joints)};
  float* input = posed.input.data_ptr<float>();
  std::memcpy(input, constant_input_.data(), constant_input_.size() * sizeof(float));

  PoseView seen = pose;
  std::vector<float> frozen;
  if (settings_.freeze_pose) {
    frozen.resize(pose.rotations.size());
    for (uint32_t j = 0; j < joints; ++j) frozen[4 * j] = 1;
    std::copy_n(pose.rotations.begin(), 4, frozen.begin());
    seen.rotations = frozen;
    seen.root_translation_m = {0, 0, 0};  // the maps leave it out; so do their last bits now
  }
  draw_pose_maps(body_, seen, MapStatistics{}, posed.world_from_rest, channels,
                 {input, constant_input_.size()});
  skinning_transforms({body_.parents, joint_position_m_}, pose, posed.world_from_rest);
  return posed;
}

model::HeadFrame AvatarModel::head_frame(const PosedBody& posed) const {
  return {.body = &body_,
          .texel_position_m = texel_position_m_,
          .world_from_rest = posed.world_from_rest,
          .decoding = settings_.decoding};
}

torch::Tensor AvatarModel::evaluate(const PosedBody& posed) {
  torch::NoGradGuard no_gradient;
  return unet_.forward(posed.input);
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

}  // namespace figurine::train
