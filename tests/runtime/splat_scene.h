// Gaussian sets for the splatting tests, with the storage behind their views, and a renderer
// without avatars.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "figurine/renderer.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

// SH coefficient of the constant band that gives a colour channel this value.
inline float dc_of(float colour) { return (colour - kShOffset) / kSh0; }

struct Scene {
  uint32_t sh_degree = 0;
  std::vector<float> position, factor, opacity, sh;

  void add(std::array<float, 3> place, std::array<float, 9> f, float o,
           std::vector<float> coefficients) {
    position.insert(position.end(), place.begin(), place.end());
    factor.insert(factor.end(), f.begin(), f.end());
    opacity.push_back(o);
    sh.insert(sh.end(), coefficients.begin(), coefficients.end());
  }
  // An isotropic Gaussian of one colour.
  void add_ball(std::array<float, 3> place, float deviation_m, float o,
                std::array<float, 3> colour) {
    add(place, {deviation_m, 0, 0, 0, deviation_m, 0, 0, 0, deviation_m}, o,
        {dc_of(colour[0]), dc_of(colour[1]), dc_of(colour[2])});
  }
  GaussianView view() const {
    return {.count = static_cast<uint32_t>(opacity.size()),
            .sh_degree = sh_degree,
            .position_m = position,
            .covariance_factor = factor,
            .opacity = opacity,
            .sh = sh};
  }
};

// At the origin, looking along +z; the principal point is the image's centre unless moved.
inline Camera front_camera(uint32_t width_px, uint32_t height_px, float focal_px) {
  return {.width_px = width_px,
          .height_px = height_px,
          .fx_px = focal_px,
          .fy_px = focal_px,
          .cx_px = 0.5f * static_cast<float>(width_px),
          .cy_px = 0.5f * static_cast<float>(height_px)};
}

struct FloatImage {
  uint32_t width = 0;
  std::vector<float> rgba;  // straight
  std::array<float, 4> at(uint32_t x, uint32_t y) const {
    const float* p = &rgba[(size_t(y) * width + x) * 4];
    return {p[0], p[1], p[2], p[3]};
  }
};

inline std::unique_ptr<Renderer> make_renderer(uint32_t threads = 1) {
  Result<std::unique_ptr<Renderer>> renderer =
      Renderer::create({.threads = threads, .allow_oversubscription = true});
  FIG_CHECK(renderer.ok(), renderer.status().message().c_str());
  return std::move(renderer).value();
}

inline FloatImage render(Renderer& renderer, const Frame& frame) {
  FloatImage image{
      .width = frame.camera.width_px,
      .rgba = std::vector<float>(size_t(frame.camera.width_px) * frame.camera.height_px * 4, NAN)};
  const Status status = renderer.render(frame, {.pixels = image.rgba.data(),
                                                .stride_bytes = size_t(16) * image.width,
                                                .format = PixelFormat::kRgbaF32});
  EXPECT_TRUE(status.ok()) << status.message();
  return image;
}

inline FloatImage render(const Scene& scene, const Camera& camera, const SplatOptions& splat = {},
                         uint32_t threads = 1) {
  const std::unique_ptr<Renderer> renderer = make_renderer(threads);
  const GaussianView view = scene.view();
  return render(*renderer, {.camera = camera, .gaussians = {&view, 1}, .splat = splat});
}

// A random cloud before the front camera: discs, needles and balls, all orientations, some partly
// outside the image.
Scene make_random_scene(uint32_t count, uint32_t sh_degree, uint64_t seed);

}  // namespace figurine::tests
