#include "toolchain/pictures/avatar_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "toolchain/measure/body_parts.h"

namespace figurine::pictures {

using measure::Box;
using measure::Picture;
using measure::quantise_picture;

namespace {

// SMPL-X joint order (toolchain/body/skeleton.h): head 15, jaw 22, eyes 23 and 24; wrist 20 and the
// fingers 25..39.
constexpr std::array<uint8_t, 4> kHeadJoints{15, 22, 23, 24};
constexpr std::array<uint8_t, 16> kLeftHandJoints{20, 25, 26, 27, 28, 29, 30, 31,
                                                  32, 33, 34, 35, 36, 37, 38, 39};

}  // namespace

std::span<const uint8_t> head_joints() { return kHeadJoints; }
std::span<const uint8_t> left_hand_joints() { return kLeftHandJoints; }

PosedFrame pose_frame(train::TrainedAvatar& avatar, size_t frame) {
  train::AvatarModel& model = avatar.model();
  PosedFrame result{model.pose(model.from_capture(avatar.data().frames()[frame]).view()), {}};
  result.head = model.evaluate(result.posed);
  return result;
}

Picture render_picture(train::TrainedAvatar& avatar, const PosedFrame& posed,
                       const Camera& camera) {
  return quantise_picture(camera.width_px, camera.height_px,
                          avatar.model().render_rgba(posed.head, posed.posed, camera));
}

Picture true_picture(const dataset::Dataset& data, size_t frame, size_t camera) {
  const dataset::CaptureImage image = data.load_image(frame, camera);
  Picture picture{image.width_px, image.height_px, std::vector<uint8_t>(image.alpha.size() * 4)};
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    std::copy_n(&image.rgb[3 * i], 3, &picture.rgba[4 * i]);
    picture.rgba[4 * i + 3] = image.alpha[i];
  }
  return picture;
}

Box projected_box(const train::AvatarModel& model, const train::PosedBody& posed,
                  const Camera& camera, std::span<const uint8_t> joints, float enlarge) {
  const Body& body = model.body();
  const model::HeadFrame head = model.head_frame(posed);
  float x0 = 1e9f, y0 = 1e9f, x1 = -1e9f, y1 = -1e9f;
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    if (std::find(joints.begin(), joints.end(), measure::strongest_joint(body, i)) == joints.end())
      continue;
    const Affine transform =
        blend(posed.world_from_rest, &body.texel_joints[size_t(i) * kSkinInfluences],
              &body.texel_weights[size_t(i) * kSkinInfluences]);
    const std::array<float, 3> world =
        transform_point(transform, &head.texel_position_m[size_t(i) * 3]);
    const std::array<float, 3> view = transform_point({camera.view_from_world}, world.data());
    if (!(view[2] > camera.near_m)) continue;
    const float x = camera.fx_px * view[0] / view[2] + camera.cx_px,
                y = camera.fy_px * view[1] / view[2] + camera.cy_px;
    x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
  }
  if (x1 < x0) return {};
  const float dx = enlarge * (x1 - x0), dy = enlarge * (y1 - y0);
  const auto bound = [](float value, uint32_t side) {
    return std::clamp(static_cast<int>(value), 0, static_cast<int>(side));
  };
  const Box box{
      bound(std::floor(x0 - dx), camera.width_px), bound(std::floor(y0 - dy), camera.height_px),
      bound(std::ceil(x1 + dx), camera.width_px), bound(std::ceil(y1 + dy), camera.height_px)};
  return box.empty() ? Box{} : box;
}

}  // namespace figurine::pictures
