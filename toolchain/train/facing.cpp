#include "toolchain/train/facing.h"

#include <array>

#include "figurine/check.h"

namespace figurine::train {

float facing(const Body& body, const dataset::CaptureFrame& frame, const Camera& camera) {
  constexpr int kHead = 15;  // SMPL-X joint order (toolchain/body/skeleton.h)
  FIG_CHECK(body.joint_count() > kHead, "a body with a head");
  std::array<float, 3> forward{0, 0, 1};
  for (int joint = kHead; joint >= 0; joint = body.parents[static_cast<size_t>(joint)]) {
    const std::array<float, 9> r =
        rotation_from_quaternion(&frame.rotations[static_cast<size_t>(joint) * 4]);
    std::array<float, 3> turned{0, 0, 0};
    for (size_t i = 0; i < 3; ++i) {
      for (size_t k = 0; k < 3; ++k) turned[i] += r[3 * i + k] * forward[k];
    }
    forward = turned;
  }
  const float* axis = &camera.view_from_world[8];  // the third row: where the camera looks
  return -(axis[0] * forward[0] + axis[1] * forward[1] + axis[2] * forward[2]);
}

}  // namespace figurine::train
