#include "toolchain/verify/device_avatar.h"

#include "figurine/renderer.h"
#include "toolchain/error.h"

namespace figurine::verify {

DeviceAvatar::DeviceAvatar(const Avatar& avatar, const Package& body)
    : renderer_(value_or_throw(Renderer::create({.threads = 1}), "runtime")),
      avatar_(value_or_throw(renderer_->add_avatar(avatar, body, Precision::kFloat32), "runtime")),
      antialiased_(avatar.antialiased) {}

DeviceAvatar::~DeviceAvatar() = default;

void DeviceAvatar::pose(const PoseView& pose) {
  const GaussianView view = value_or_throw(renderer_->pose_avatar(avatar_, pose), "runtime");
  sh_degree_ = view.sh_degree;
  position_m_.assign(view.position_m.begin(), view.position_m.end());
  covariance_factor_.assign(view.covariance_factor.begin(), view.covariance_factor.end());
  opacity_.assign(view.opacity.begin(), view.opacity.end());
  sh_.assign(view.sh.begin(), view.sh.end());
}

measure::Picture DeviceAvatar::draw(const Camera& camera, const std::array<float, 3>& offset_m) {
  Camera moved = camera;  // the other way round: R (x + o) + t = R x + (R o + t)
  for (int row = 0; row < 3; ++row) {
    for (int k = 0; k < 3; ++k)
      moved.view_from_world[4 * row + 3] += camera.view_from_world[4 * row + k] * offset_m[k];
  }
  const GaussianView gaussians[] = {{.count = static_cast<uint32_t>(opacity_.size()),
                                     .sh_degree = sh_degree_,
                                     .position_m = position_m_,
                                     .covariance_factor = covariance_factor_,
                                     .opacity = opacity_,
                                     .sh = sh_}};
  std::vector<float> rgba(size_t(camera.width_px) * camera.height_px * 4);
  const Frame frame{.camera = moved,
                    .avatars = {},
                    .gaussians = gaussians,
                    .background = {},
                    .splat = {.antialiased = antialiased_}};
  throw_if_error(renderer_->render(frame, {.pixels = rgba.data(),
                                           .stride_bytes = 4 * sizeof(float) * camera.width_px,
                                           .format = PixelFormat::kRgbaF32}),
                 "runtime");
  for (size_t at = 0; at < rgba.size(); at += 4) {
    for (int c = 0; c < 3; ++c) rgba[at + c] *= rgba[at + 3];
  }
  return measure::quantise_picture(camera.width_px, camera.height_px, rgba);
}

}  // namespace figurine::verify
