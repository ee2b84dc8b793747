// Random and hand-made Gaussians for the splatter's tests, in double; a float copy is exact where
// `float_values` asks for it.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "figurine/camera.h"
#include "oracle/splat_oracle.h"
#include "toolchain/model/head.h"
#include "toolchain/model/splatter.h"

namespace figurine::testing {

struct SceneOptions {
  uint32_t count = 300;
  uint32_t sh_degree = 0;
  double scale_m = 0.03;      // median of the log-normal scale
  double scale_spread = 0.6;  // its standard deviation in log
  double extent_m = 1.0;      // half size of the cube they fill
  double low_opacity = 0.2, high_opacity = 0.9;
  uint32_t seed = 1;
};

inline oracle::Gaussians random_gaussians(const SceneOptions& options) {
  std::mt19937 random(options.seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  oracle::Gaussians scene{options.count, options.sh_degree, {}, {}, {}, {}};
  const auto exact = [](double value) { return static_cast<double>(static_cast<float>(value)); };
  for (uint32_t i = 0; i < options.count; ++i) {
    for (int k = 0; k < 3; ++k)
      scene.position_m.push_back(exact(options.extent_m * uniform(random)));
    double q[4], length2 = 0, scale[3];
    for (double& value : q) value = normal(random), length2 += value * value;
    for (double& value : q) value /= std::sqrt(length2);
    for (double& value : scale)
      value = options.scale_m * std::exp(options.scale_spread * normal(random));
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    for (int k = 0; k < 9; ++k) scene.covariance_factor.push_back(exact(r[k] * scale[k % 3]));
    scene.opacity.push_back(
        exact(options.low_opacity +
              (options.high_opacity - options.low_opacity) * 0.5 * (1 + uniform(random))));
    for (uint32_t k = 0; k < 3 * sh_coefficients(options.sh_degree); ++k)
      scene.sh.push_back(exact((k < 3 ? 1.0 : 0.3) * normal(random)));
  }
  return scene;
}

// 3.2 m in front of the origin, a little off axis, principal point off centre.
inline Camera test_camera(uint32_t size) {
  Camera camera = *make_orbit_camera({.azimuth_deg = 25,
                                      .elevation_deg = 12,
                                      .distance_m = 3.2f,
                                      .vertical_fov_deg = 42,
                                      .target_m = {0, 0, 0}},
                                     size, size);
  camera.fx_px *= 1.05f;
  camera.cx_px += 0.07f * static_cast<float>(size);
  camera.cy_px -= 3.3f;
  return camera;
}

template <class Scalar>
model::GaussianBuffer<Scalar> to_buffer(const oracle::Gaussians& scene) {
  model::GaussianBuffer<Scalar> buffer;
  buffer.resize(scene.count, scene.sh_degree);
  const auto copy = [](const std::vector<double>& from, std::vector<Scalar>& to) {
    for (size_t i = 0; i < from.size(); ++i) to[i] = static_cast<Scalar>(from[i]);
  };
  copy(scene.position_m, buffer.position_m);
  copy(scene.covariance_factor, buffer.covariance_factor);
  copy(scene.opacity, buffer.opacity);
  copy(scene.sh, buffer.sh);
  return buffer;
}

template <class Scalar>
std::vector<Scalar> splat(model::Splatter<Scalar>& splatter,
                          const model::GaussianBuffer<Scalar>& gaussians, const Camera& camera,
                          const model::PixelRect& crop) {
  std::vector<Scalar> image(size_t(4) * crop.width * crop.height);
  splatter.forward(gaussians.view(), camera, crop, image.data());
  return image;
}

// Planes to interleaved RGBA.
template <class Scalar>
std::vector<Scalar> interleave(const std::vector<Scalar>& planes) {
  std::vector<Scalar> pixels(planes.size());
  const size_t count = planes.size() / 4;
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < 4; ++c) pixels[4 * i + c] = planes[c * count + i];
  }
  return pixels;
}

}  // namespace figurine::testing
