#include "samples/common/follow_camera.h"

#include <cmath>

namespace figurine::samples {

const Camera& FollowCamera::step(const std::array<float, 3>& place_m, double interval_s) {
  if (!follow_) return camera_;
  const bool jumped = std::hypot(place_m[0] - last_m_[0], place_m[2] - last_m_[2]) > kJump_m;
  const float share =
      jumped ? 1.0f : static_cast<float>(1 - std::exp(-interval_s / kTimeConstant_s));
  last_m_ = place_m;
  float moved[3] = {0, 0, 0};
  for (const size_t k : {size_t{0}, size_t{2}}) {
    at_m_[k] += share * (place_m[k] - at_m_[k]);
    moved[k] = at_m_[k] - first_m_[k];
  }
  // The eye goes along: x_view = R (x - moved) + t.
  for (size_t r = 0; r < 3; ++r) {
    const float* row = &start_.view_from_world[4 * r];
    camera_.view_from_world[4 * r + 3] =
        row[3] - (row[0] * moved[0] + row[1] * moved[1] + row[2] * moved[2]);
  }
  return camera_;
}

}  // namespace figurine::samples
