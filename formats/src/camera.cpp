#include "figurine/camera.h"

#include <cmath>

#include "figurine/detail/double_math.h"

namespace figurine {

namespace {

constexpr uint32_t kMaxImageSize = 16384;

Status invalid(const char* what) {
  return Status(StatusCode::kInvalidArgument, std::string("camera: ") + what);
}

bool is_rotation(const std::array<float, 12>& m) {
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = i; j < 3; ++j) {
      double dot = 0;
      for (size_t k = 0; k < 3; ++k) dot += double(m[4 * i + k]) * m[4 * j + k];
      if (!(std::abs(dot - (i == j ? 1.0 : 0.0)) <= 1e-3)) return false;
    }
  }
  const double determinant = double(m[0]) * (double(m[5]) * m[10] - double(m[6]) * m[9]) -
                             double(m[1]) * (double(m[4]) * m[10] - double(m[6]) * m[8]) +
                             double(m[2]) * (double(m[4]) * m[9] - double(m[5]) * m[8]);
  return determinant > 0;
}

SineCosine sine_cosine_of_degrees(double degrees) {
  const double turns = degrees / 360;
  return sine_cosine_of_turns(turns - std::floor(turns));
}

}  // namespace

Status validate_camera(const Camera& camera) {
  if (camera.width_px < 1 || camera.width_px > kMaxImageSize || camera.height_px < 1 ||
      camera.height_px > kMaxImageSize) {
    return invalid("image size must be between 1 and 16384 pixels a side");
  }
  for (float focal : {camera.fx_px, camera.fy_px}) {
    if (!(focal > 0) || !std::isfinite(focal))
      return invalid("focal lengths must be positive and finite");
  }
  if (!std::isfinite(camera.cx_px) || !std::isfinite(camera.cy_px))
    return invalid("the principal point must be finite");
  for (float value : camera.view_from_world) {
    if (!std::isfinite(value)) return invalid("the world-to-camera transform must be finite");
  }
  if (!is_rotation(camera.view_from_world))
    return invalid("the world-to-camera transform must be a rotation and a translation");
  if (!(camera.near_m > 0) || !std::isfinite(camera.near_m))
    return invalid("the near distance must be positive and finite");
  return {};
}

Result<Camera> make_orbit_camera(const OrbitCamera& orbit, uint32_t width_px, uint32_t height_px) {
  if (!std::isfinite(orbit.azimuth_deg)) return invalid("orbit azimuth must be finite");
  if (!(std::abs(orbit.elevation_deg) <= 90))
    return invalid("orbit elevation must be within -90 and 90 degrees");
  if (!(orbit.distance_m > 0) || !std::isfinite(orbit.distance_m))
    return invalid("orbit distance must be positive and finite");
  if (!(orbit.vertical_fov_deg >= 1 && orbit.vertical_fov_deg <= 170))
    return invalid("orbit field of view must be within 1 and 170 degrees");
  const SineCosine azimuth = sine_cosine_of_degrees(orbit.azimuth_deg),
                   elevation = sine_cosine_of_degrees(orbit.elevation_deg),
                   half_fov = sine_cosine_of_degrees(0.5 * orbit.vertical_fov_deg);
  // Unit vector from target to camera; forward is its opposite. right = forward x up; down
  // completes the OpenCV frame.
  const double from_target[3] = {azimuth.sine * elevation.cosine, elevation.sine,
                                 azimuth.cosine * elevation.cosine};
  const double forward[3] = {-from_target[0], -from_target[1], -from_target[2]};
  const double right[3] = {azimuth.cosine, 0, -azimuth.sine};
  const double down[3] = {forward[1] * right[2] - forward[2] * right[1],
                          forward[2] * right[0] - forward[0] * right[2],
                          forward[0] * right[1] - forward[1] * right[0]};
  Camera camera{.width_px = width_px, .height_px = height_px};
  camera.fy_px = static_cast<float>(0.5 * height_px * half_fov.cosine / half_fov.sine);
  camera.fx_px = camera.fy_px;
  camera.cx_px = 0.5f * static_cast<float>(width_px);
  camera.cy_px = 0.5f * static_cast<float>(height_px);
  const double* rows[3] = {right, down, forward};
  for (size_t i = 0; i < 3; ++i) {
    double translation = 0;
    for (size_t k = 0; k < 3; ++k) {
      const double centre = orbit.target_m[k] + orbit.distance_m * from_target[k];
      camera.view_from_world[4 * i + k] = static_cast<float>(rows[i][k]);
      translation -= rows[i][k] * centre;
    }
    camera.view_from_world[4 * i + 3] = static_cast<float>(translation);
  }
  FIG_RETURN_IF_ERROR(validate_camera(camera));
  return camera;
}

}  // namespace figurine
