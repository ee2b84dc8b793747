#include "samples/emulator/orbit_view.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

namespace figurine::emulator {

namespace {

constexpr float kDegreesAPixel = 0.25f;
constexpr float kStep = 0.9f;  // of the distance, a step of the wheel

}  // namespace

void OrbitView::set(const OrbitCamera& orbit) {
  orbit_ = orbit;
  orbit_.azimuth_deg = std::remainder(orbit.azimuth_deg, 360.0f);
  orbit_.elevation_deg = std::clamp(orbit.elevation_deg, -kHighest_deg, kHighest_deg);
  orbit_.distance_m = std::clamp(orbit.distance_m, kNearest_m, kFarthest_m);
}

void OrbitView::turn(float right_px, float down_px) {
  OrbitCamera turned = orbit_;
  turned.azimuth_deg -= right_px * kDegreesAPixel;
  turned.elevation_deg += down_px * kDegreesAPixel;
  set(turned);
}

void OrbitView::shift(float right_px, float down_px, float picture_height_px) {
  const float azimuth = glm::radians(orbit_.azimuth_deg),
              elevation = glm::radians(orbit_.elevation_deg);
  const glm::vec3 right(std::cos(azimuth), 0, -std::sin(azimuth));
  const glm::vec3 toward(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                         std::cos(azimuth) * std::cos(elevation));
  const glm::vec3 up = glm::cross(toward, right);
  const float metres_a_pixel = 2 * orbit_.distance_m *
                               std::tan(glm::radians(orbit_.vertical_fov_deg) / 2) /
                               std::max(picture_height_px, 1.0f);
  const glm::vec3 moved = metres_a_pixel * (down_px * up - right_px * right);
  for (int k = 0; k < 3; ++k) orbit_.target_m[static_cast<size_t>(k)] += moved[k];
}

void OrbitView::zoom(float steps) {
  OrbitCamera nearer = orbit_;
  nearer.distance_m *= std::pow(kStep, std::clamp(steps, -50.0f, 50.0f));
  set(nearer);
}

Result<Camera> OrbitView::camera(const std::array<float, 3>& followed_m,
                                 samples::ImageSize size) const {
  OrbitCamera here = orbit_;
  for (size_t k = 0; k < 3; ++k) here.target_m[k] += followed_m[k];
  Result<Camera> camera = make_orbit_camera(here, size.width_px, size.height_px);
  if (camera.ok()) camera->near_m = std::min(camera->near_m, 0.3f * here.distance_m);
  return camera;
}

}  // namespace figurine::emulator
