#include "toolchain/train/reference_gaussians.h"

#include <algorithm>
#include <cmath>

#include "toolchain/tensor_operations.h"
#include "toolchain/train/sample_feed.h"

namespace figurine::train {

namespace {

constexpr size_t kImages = 48;
constexpr float kFacingCosine = 0.3f;
constexpr uint32_t kColourChannel = 11;  // first SH output of the head

std::array<float, 3> to_view(const Camera& camera, const std::array<float, 3>& world) {
  const auto& m = camera.view_from_world;
  std::array<float, 3> view;
  for (int i = 0; i < 3; ++i)
    view[i] =
        m[4 * i] * world[0] + m[4 * i + 1] * world[1] + m[4 * i + 2] * world[2] + m[4 * i + 3];
  return view;
}

}  // namespace

torch::Tensor reference_head(const dataset::Dataset& data, const AvatarModel& model) {
  const Body& body = model.body();
  const uint32_t count = body.texel_count();
  std::vector<float> colour(size_t(count) * 3, 0.0f), weight(count, 0.0f);
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      if (data.role(frame, camera) == dataset::Role::kTrain) pairs.emplace_back(frame, camera);
    }
  }
  // Spread over frames and cameras: a stride that shares no factor with the number of cameras would
  // be ideal; an odd one does.
  const size_t step = std::max<size_t>(1, pairs.size() / kImages) | 1;
  for (size_t at = 0; at < pairs.size(); at += step) {
    const auto [frame, camera_index] = pairs[at];
    const Camera& camera = data.cameras()[camera_index].camera;
    const dataset::CaptureImage image = data.load_image(frame, camera_index);
    const PosedBody posed = model.pose(model.from_capture(data.frames()[frame]).view());
    const model::HeadFrame head = model.head_frame(posed);
    for (uint32_t i = 0; i < count; ++i) {
      const Affine transform =
          blend(head.world_from_rest, &body.texel_joints[size_t(i) * kSkinInfluences],
                &body.texel_weights[size_t(i) * kSkinInfluences]);
      const std::array<float, 3> world =
          transform_point(transform, &head.texel_position_m[size_t(i) * 3]);
      const std::array<float, 3> normal =
          transform_normal(transform, &body.texel_normal[size_t(i) * 3]);
      const std::array<float, 3> view = to_view(camera, world);
      if (!(view[2] > camera.near_m)) continue;
      std::array<float, 3> view_normal{0, 0, 0};
      for (int r = 0; r < 3; ++r) {
        for (int k = 0; k < 3; ++k) view_normal[r] += camera.view_from_world[4 * r + k] * normal[k];
      }
      const float length = std::sqrt(view[0] * view[0] + view[1] * view[1] + view[2] * view[2]);
      const float cosine =
          -(view[0] * view_normal[0] + view[1] * view_normal[1] + view[2] * view_normal[2]) /
          length;
      if (!(cosine > kFacingCosine)) continue;
      const float x = camera.fx_px * view[0] / view[2] + camera.cx_px,
                  y = camera.fy_px * view[1] / view[2] + camera.cy_px;
      if (!(x >= 0 && y >= 0 && x < float(image.width_px) && y < float(image.height_px))) continue;
      const size_t pixel = size_t(y) * image.width_px + size_t(x);
      if (image.alpha[pixel] < 250) continue;
      for (int c = 0; c < 3; ++c)
        colour[3 * i + c] += cosine * float(image.rgb[3 * pixel + c]) / 255.0f;
      weight[i] += cosine;
    }
  }
  const uint32_t channels = head_channels(model.settings().decoding.sh_degree);
  torch::Tensor reference = torch::zeros({int64_t(count), int64_t(channels)});
  float* out = reference.data_ptr<float>();
  for (uint32_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) {
      const float value = weight[i] > 0 ? colour[3 * i + c] / weight[i] : kShOffset;
      out[size_t(i) * channels + kColourChannel + c] = (value - kShOffset) / kSh0;
    }
  }
  return reference;
}

torch::Tensor reference_loss(const torch::Tensor& head, const torch::Tensor& reference) {
  return (head - reference).square().sum() / static_cast<double>(head.numel());
}

}  // namespace figurine::train
