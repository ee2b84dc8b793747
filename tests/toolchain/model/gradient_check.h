// Analytic gradients of the whole differentiable picture against central differences in double:
// every parameter kind on its own.
//
// Scenes are sparse (a few hundred Gaussians): in dense ones depth swaps and the alpha cut put
// jumps into the image that no gradient can follow.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/toolchain/model/scenes.h"
#include "tests/toolchain/model/synthetic_body.h"

namespace figurine::testing {

// The largest error of one kind of parameter: |analytic - numeric| / max(|analytic|, |numeric|,
// 1e-3 of the kind's largest gradient).
struct GradientError {
  double largest_relative = 0;
  double largest_gradient = 0;
  uint64_t checked = 0;
  uint64_t refined = 0;  // values that needed a smaller step
};
using GradientErrors = std::map<std::string, GradientError>;

struct Checked {
  double analytic, numeric;
  bool refined = false;
};

inline GradientError summarise(const std::vector<Checked>& values) {
  GradientError error{.checked = values.size()};
  for (const Checked& v : values) {
    error.largest_gradient = std::max(error.largest_gradient, std::abs(v.analytic));
    error.refined += v.refined;
  }
  for (const Checked& v : values) {
    const double scale =
        std::max({std::abs(v.analytic), std::abs(v.numeric), 1e-3 * error.largest_gradient});
    error.largest_relative =
        std::max(error.largest_relative, std::abs(v.analytic - v.numeric) / scale);
  }
  return error;
}

// d(sum of weights . image)/d(value) by a central difference with step h. The difference is taken
// per pixel before it is summed, so that untouched pixels add no rounding.
inline double central_difference(double& value, double h, const std::vector<double>& weights,
                                 const std::function<std::vector<double>()>& render) {
  const double kept = value;
  value = kept + h;
  const double up = value;
  const std::vector<double> above = render();
  value = kept - h;
  const double down = value;
  const std::vector<double> below = render();
  value = kept;
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) sum += weights[i] * (above[i] - below[i]);
  return sum / (up - down);
}

// With a step that does not straddle a jump (a pixel where alpha crosses the cut, or that stops):
// where the difference is not the gradient, it is taken again with steps 8 to 4096 times smaller. A
// wrong gradient stays wrong at every step; a jump leaves the interval.
inline Checked check_value(double analytic, double& value, double h,
                           const std::vector<double>& weights,
                           const std::function<std::vector<double>()>& render) {
  Checked checked{analytic, central_difference(value, h, weights, render)};
  for (double smaller = h / 8; smaller > h / 5000; smaller /= 8) {
    if (std::abs(checked.numeric - analytic) <= 1e-3 * std::abs(analytic) + 1e-6) break;
    checked = {analytic, central_difference(value, smaller, weights, render), true};
  }
  return checked;
}

inline std::vector<double> random_weights(size_t count) {
  std::mt19937 random(99);
  std::normal_distribution<double> normal;
  std::vector<double> weights(count);
  for (double& value : weights) value = normal(random);
  return weights;
}

// Gaussians in world space: position, covariance factor, opacity, SH.
inline GradientErrors check_splat_gradients(uint32_t sh_degree, uint32_t count,
                                            bool antialiased = false) {
  model::GaussianBuffer<double> gaussians =
      to_buffer<double>(random_gaussians({.count = count,
                                          .sh_degree = sh_degree,
                                          .scale_m = 0.05,
                                          .low_opacity = 0.1,
                                          .high_opacity = 1.0,
                                          .seed = 40 + sh_degree}));
  const Camera camera = test_camera(64);
  const model::PixelRect crop{.x = 3, .y = 5, .width = 58, .height = 55};
  model::Splatter<double> splatter({.threads = 1, .antialiased = antialiased});
  const std::function<std::vector<double>()> render = [&] {
    return splat(splatter, gaussians, camera, crop);
  };
  const std::vector<double> weights = random_weights(size_t(4) * crop.width * crop.height);
  const std::vector<double> image = render();
  model::GaussianBuffer<double> gradients;
  gradients.resize(gaussians.count, sh_degree);
  splatter.backward(image.data(), weights.data(), gradients.gradients());

  GradientErrors errors;
  const auto check = [&](const char* kind, std::vector<double>& values,
                         const std::vector<double>& analytic, double h, size_t limit) {
    std::vector<Checked> checked;
    for (size_t i = 0; i < std::min(limit, values.size()); ++i)
      checked.push_back(check_value(analytic[i], values[i], h, weights, render));
    errors[kind] = summarise(checked);
  };
  check("position", gaussians.position_m, gradients.position_m, 2e-7, size_t(-1));
  check("covariance_factor", gaussians.covariance_factor, gradients.covariance_factor, 2e-7,
        size_t(-1));
  check("opacity", gaussians.opacity, gradients.opacity, 1e-6, size_t(-1));
  check("sh", gaussians.sh, gradients.sh, 1e-5, size_t(60) * 3 * sh_coefficients(sh_degree));
  return errors;
}

// What limits Gaussians from below and above the pixel grid; none by default.
struct Filters {
  float smallest_extent_m = 0;  // the largest of the texels'; every fifth has none
  bool antialiased = false;
};

// The raw head outputs through decoding, skinning and splatting.
inline GradientErrors check_head_gradients(uint32_t sh_degree, const Filters& filters = {}) {
  const SyntheticBody capsule(16, 14);
  const std::vector<Affine> transforms = capsule.bent();
  const uint32_t channels = head_channels(sh_degree), texels = capsule.body.texel_count();
  std::vector<float> smallest;
  for (uint32_t i = 0; i < texels && filters.smallest_extent_m > 0; ++i)
    smallest.push_back(filters.smallest_extent_m * static_cast<float>(i % 5) / 4);
  const model::HeadFrame frame{.body = &capsule.body,
                               .texel_position_m = capsule.position,
                               .world_from_rest = transforms,
                               .decoding = {.sh_degree = sh_degree},
                               .smallest_extent_m = smallest};
  std::mt19937 random(270 + sh_degree);
  std::normal_distribution<double> normal;
  std::vector<double> head(size_t(texels) * channels);
  for (double& value : head) value = 0.4 * normal(random);
  for (uint32_t i = 0; i < texels; ++i)
    head[size_t(i) * channels + 10] -= 2;  // opacities around one half
  const Camera camera = *make_orbit_camera({.azimuth_deg = 20,
                                            .elevation_deg = 5,
                                            .distance_m = 3,
                                            .vertical_fov_deg = 36,
                                            .target_m = {0, 0.87f, 0}},
                                           56, 56);
  const model::PixelRect crop{.x = 0, .y = 0, .width = 56, .height = 56};
  model::Splatter<double> splatter({.threads = 1, .antialiased = filters.antialiased});
  model::GaussianBuffer<double> gaussians, gradients;
  const std::function<std::vector<double>()> render = [&] {
    decode_head(frame, head.data(), 1, gaussians);
    return splat(splatter, gaussians, camera, crop);
  };
  const std::vector<double> weights = random_weights(size_t(4) * crop.width * crop.height);
  const std::vector<double> image = render();
  gradients.resize(texels, sh_degree);
  splatter.backward(image.data(), weights.data(), gradients.gradients());
  std::vector<double> analytic(head.size());
  decode_head_backward(frame, head.data(), gradients, 1, analytic.data());

  GradientErrors errors;
  const auto check = [&](const char* kind, uint32_t first, uint32_t last, uint32_t step, double h) {
    std::vector<Checked> checked;
    for (uint32_t i = 0; i < texels; i += step) {
      for (uint32_t c = first; c < last; ++c) {
        const size_t at = size_t(i) * channels + c;
        checked.push_back(check_value(analytic[at], head[at], h, weights, render));
      }
    }
    errors[kind] = summarise(checked);
  };
  check("head_offset", 0, 3, 1, 4e-6);
  check("head_log_scale", 3, 6, 1, 4e-6);
  check("head_rotation", 6, 10, 1, 4e-6);
  check("head_opacity", 10, 11, 1, 4e-6);
  check("head_sh", 11, channels, sh_degree == 0 ? 1 : 5, 1e-5);
  return errors;
}

}  // namespace figurine::testing
