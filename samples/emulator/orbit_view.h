// A camera that a mouse moves: round what it looks at, nearer and farther, and sideways. What it
// looks at goes along with the figures; the hand's shift is kept beside that.
#pragma once

#include <array>

#include "figurine/camera.h"
#include "samples/common/parse.h"

namespace figurine::emulator {

class OrbitView {
 public:
  static constexpr float kNearest_m = 0.15f, kFarthest_m = 100, kHighest_deg = 89.9f;

  // Begins anew from there; its target is relative to what is followed.
  void set(const OrbitCamera& orbit);
  // A drag of so many pixels to the right and down turns what is seen by the hand: half a turn for
  // the picture's width of 720 pixels.
  void turn(float right_px, float down_px);
  // Shifts what is seen with the hand, in a picture of that height.
  void shift(float right_px, float down_px, float picture_height_px);
  // Steps of a wheel; positive: nearer.
  void zoom(float steps);

  const OrbitCamera& orbit() const { return orbit_; }
  // kInvalidArgument as make_orbit_camera().
  Result<Camera> camera(const std::array<float, 3>& followed_m, samples::ImageSize size) const;

 private:
  OrbitCamera orbit_;
};

}  // namespace figurine::emulator
