// An avatar as the device draws it, for tools that have an Avatar but no trainer: a population's
// members, or weights that no package holds. The network runs once a pose, however many cameras
// look.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "figurine/camera.h"
#include "figurine/gaussian.h"
#include "figurine/package.h"
#include "figurine/pose.h"
#include "toolchain/measure/metrics.h"

namespace figurine {
class Renderer;
enum class AvatarId : uint32_t;
}  // namespace figurine

namespace figurine::verify {

class DeviceAvatar {
 public:
  // In float, on one thread. The avatar's arrays and the body are borrowed. Throws InputError if
  // the avatar does not fit the body.
  DeviceAvatar(const Avatar& avatar, const Package& body);
  ~DeviceAvatar();
  DeviceAvatar(const DeviceAvatar&) = delete;
  DeviceAvatar& operator=(const DeviceAvatar&) = delete;

  // Runs the network; what is drawn next is in this pose. Throws InputError on a pose that is not
  // one.
  void pose(const PoseView& pose);
  // World centres of the posed Gaussians, [N,3] in the order of the body's texels; valid until the
  // next pose.
  std::span<const float> centres_m() const { return position_m_; }
  // The posed avatar, moved by `offset_m`.
  measure::Picture draw(const Camera& camera, const std::array<float, 3>& offset_m = {0, 0, 0});

 private:
  std::unique_ptr<Renderer> renderer_;
  AvatarId avatar_{};
  bool antialiased_ = false;
  uint32_t sh_degree_ = 0;
  std::vector<float> position_m_, covariance_factor_, opacity_,
      sh_;  // copies: the renderer's are valid until its next call
};

}  // namespace figurine::verify
