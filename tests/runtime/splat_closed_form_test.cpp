// Pictures that can be computed by hand: one Gaussian, two, an opaque stack, the cut, the near
// plane, extremes of size and opacity.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "largest_error.h"
#include "runtime/splat_scene.h"

namespace figurine::splat_closed_form_test {
namespace {

using tests::FloatImage;
using tests::front_camera;
using tests::render;
using tests::Scene;

// Weight of an isotropic Gaussian of deviation s on the optical axis at depth z, at dx, dy pixels
// from its mean.
double weight(double s, double z, double focal, double dx, double dy) {
  const double variance = focal * s / z * (focal * s / z) + double(kDilationPx2);
  return std::exp(-0.5 * (dx * dx + dy * dy) / variance);
}

TEST(SplatClosedForm, OneGaussianIsItsBell) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.1f, 0.8f, {0.9f, 0.5f, 0.25f});
  const FloatImage image = render(scene, front_camera(64, 48, 100));
  LargestError alpha_error("alpha"), colour_error("straight colour");
  for (uint32_t y = 0; y < 48; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      const double alpha = 0.8f * weight(0.1f, 2, 100, x + 0.5 - 32, y + 0.5 - 24);
      if (std::abs(alpha - kAlphaCut) < 1e-6) continue;
      const std::array<float, 4> pixel = image.at(x, y);
      alpha_error.add(pixel[3], alpha < kAlphaCut ? 0 : alpha);
      if (alpha < kAlphaCut) {
        EXPECT_EQ(pixel, (std::array<float, 4>{0, 0, 0, 0})) << x << "," << y;
      } else {
        // Straight colour divides by alpha = 1 - T, whose rounding weighs 2^-24 / alpha.
        for (int c = 0; c < 3; ++c)
          colour_error.add((pixel[c] - std::array{0.9f, 0.5f, 0.25f}[c]) * alpha);
      }
    }
  }
  EXPECT_LE(alpha_error.largest(), 4e-7);
  EXPECT_LE(colour_error.largest(), 3e-7);
}

TEST(SplatClosedForm, AnOffAxisDiscFollowsTheJacobian) {
  // A disc facing the camera, away from the axis: the covariance is (f s / z)^2 times [[1 + tx^2 e,
  // ...]] with e = 0 for a flat disc.
  Scene scene;
  scene.add({0.5f, -0.25f, 2}, {0.05f, 0, 0, 0, 0.05f, 0, 0, 0, 0}, 1,
            {tests::dc_of(1), tests::dc_of(1), tests::dc_of(1)});
  const FloatImage image = render(scene, front_camera(96, 96, 120));
  LargestError error("alpha of an off-axis disc");
  const double mean_x = 120 * 0.25 + 48, mean_y = -120 * 0.125 + 48;
  for (uint32_t y = 0; y < 96; ++y) {
    for (uint32_t x = 0; x < 96; ++x) {
      const double alpha =
          std::min(double(kAlphaMax), weight(0.05f, 2, 120, x + 0.5 - mean_x, y + 0.5 - mean_y));
      if (std::abs(alpha - kAlphaCut) < 1e-6) continue;
      error.add(image.at(x, y)[3], alpha < kAlphaCut ? 0 : alpha);
    }
  }
  EXPECT_LE(error.largest(), 2e-6);
}

TEST(SplatClosedForm, TwoGaussiansBlendFrontToBack) {
  // The far one is given first: order follows depth, not the list.
  Scene scene;
  scene.add_ball({0, 0, 3}, 0.45f, 0.9f, {0, 0, 1});
  scene.add_ball({0, 0, 2}, 0.3f, 0.6f, {1, 0, 0});
  const FloatImage image = render(scene, front_camera(32, 32, 100));
  LargestError error("two Gaussians");
  for (uint32_t y = 0; y < 32; ++y) {
    for (uint32_t x = 0; x < 32; ++x) {
      const double dx = x + 0.5 - 16, dy = y + 0.5 - 16;
      const double front = 0.6f * weight(0.3f, 2, 100, dx, dy),
                   back = 0.9f * weight(0.45f, 3, 100, dx, dy);
      ASSERT_GT(std::min(front, back), kAlphaCut);
      const std::array<float, 4> pixel = image.at(x, y);
      const double alpha = 1 - (1 - front) * (1 - back);
      error.add(pixel[3], alpha);
      error.add(pixel[0] * pixel[3], front);
      error.add(pixel[2] * pixel[3], (1 - front) * back);
      error.add(pixel[1]);
    }
  }
  EXPECT_LE(error.largest(), 6e-7);
}

TEST(SplatClosedForm, OpaqueStopsAtTheFirst) {
  // Alpha is clamped to 0.99; a second such layer would leave 1e-4 - 2e-9 of the light, so the
  // pixel stops before it.
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.5f, 1, {0.25f, 0.5f, 0.75f});
  scene.add_ball({0, 0, 3}, 0.5f, 1, {1, 1, 1});
  Camera camera = front_camera(33, 33, 50);
  const std::array<float, 4> centre = render(scene, camera).at(16, 16);
  EXPECT_NEAR(centre[3], 0.99, 1e-7);
  EXPECT_NEAR(centre[0], 0.25, 1e-6);
  EXPECT_NEAR(centre[1], 0.5, 1e-6);
  EXPECT_NEAR(centre[2], 0.75, 1e-6);
}

TEST(SplatClosedForm, AStoppedPixelStaysStopped) {
  // Alpha 0.99, then 0.995-like (stops), then a faint one that alone would not have taken the light
  // below 1e-4.
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.5f, 1, {0, 0, 0});
  scene.add_ball({0, 0, 3}, 0.5f, 1, {0, 0, 0});
  scene.add_ball({0, 0, 4}, 0.5f, 0.1f, {1, 1, 1});
  const std::array<float, 4> centre = render(scene, front_camera(33, 33, 50)).at(16, 16);
  EXPECT_EQ(centre[0], 0);
  EXPECT_NEAR(centre[3], 0.99, 1e-7);
}

TEST(SplatClosedForm, EqualDepthsKeepTheirOrder) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.2f, 1, {1, 0, 0});
  scene.add_ball({0, 0, 2}, 0.2f, 1, {0, 1, 0});
  const std::array<float, 4> centre = render(scene, front_camera(33, 33, 50)).at(16, 16);
  EXPECT_GT(centre[0], 0.98f);
  EXPECT_EQ(centre[1], 0);
}

TEST(SplatClosedForm, DepthsThatDifferInTheLastBitAreSorted) {
  Scene scene;
  const float near_m = 2.0f, far_m = std::nextafter(near_m, 3.0f);
  scene.add_ball({0, 0, far_m}, 0.2f, 1, {1, 0, 0});
  scene.add_ball({0, 0, near_m}, 0.2f, 1, {0, 1, 0});
  const std::array<float, 4> centre = render(scene, front_camera(33, 33, 50)).at(16, 16);
  EXPECT_EQ(centre[0], 0);
  EXPECT_GT(centre[1], 0.98f);
}

TEST(SplatClosedForm, TheNearPlaneCullsAndIsAnOption) {
  Camera camera = front_camera(33, 33, 20);
  for (const float z : {-1.0f, 0.0f, 0.2f}) {
    Scene scene;
    scene.add_ball({0, 0, z}, 0.05f, 0.9f, {1, 1, 1});
    EXPECT_EQ(render(scene, camera).at(16, 16)[3], 0) << "z = " << z << ": at the plane or behind";
  }
  Scene scene;
  scene.add_ball({0, 0, 0.1f}, 0.01f, 0.9f, {1, 1, 1});
  EXPECT_EQ(render(scene, camera).at(16, 16)[3], 0);
  camera.near_m = 0.01f;
  EXPECT_NEAR(render(scene, camera).at(16, 16)[3], 0.9, 1e-6);
}

TEST(SplatClosedForm, TheAlphaCutIsAnOption) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.1f, 0.8f, {1, 1, 1});
  const Camera camera = front_camera(65, 65, 100);
  for (const float cut : {0.5f, 1.0f / 64, kAlphaCut, 1e-3f, 1e-6f}) {
    const FloatImage image = render(scene, camera, {.alpha_cut = cut});
    uint32_t covered = 0, expected = 0, doubtful = 0;
    for (uint32_t y = 0; y < 65; ++y) {
      for (uint32_t x = 0; x < 65; ++x) {
        const double alpha = 0.8f * weight(0.1f, 2, 100, x + 0.5 - 32.5, y + 0.5 - 32.5);
        covered += image.at(x, y)[3] > 0;
        expected += alpha >= cut;
        doubtful += std::abs(alpha / cut - 1) < 1e-6;
      }
    }
    EXPECT_NEAR(covered, expected, doubtful) << "cut " << cut;
  }
}

TEST(SplatClosedForm, AGaussianSmallerThanAPixelIsTheDilation) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 1e-9f, 1, {1, 1, 1});
  Camera camera = front_camera(32, 32, 100);
  camera.cx_px = camera.cy_px = 16.5f;
  const FloatImage image = render(scene, camera);
  EXPECT_NEAR(image.at(16, 16)[3], 0.99, 1e-7);
  EXPECT_NEAR(image.at(17, 16)[3], std::exp(-0.5 / 0.3), 1e-6);
  EXPECT_NEAR(image.at(17, 17)[3], std::exp(-1.0 / 0.3), 1e-6);
  EXPECT_EQ(image.at(18, 16)[3], 0) << "exp(-2 / 0.3) = 1 / 786 is below the cut";
}

TEST(SplatClosedForm, AGaussianLargerThanTheScreenIsConstant) {
  // 1 km wide before a small camera: 5e7 pixels of deviation, so the weight is 1 to 1e-11
  // everywhere.
  Scene scene;
  scene.add({0, 0, 2}, {1000, 0, 0, 0, 1000, 0, 0, 0, 0}, 0.5f,
            {tests::dc_of(0.5f), tests::dc_of(0.5f), tests::dc_of(0.5f)});
  const FloatImage image = render(scene, front_camera(100, 70, 100));
  for (size_t i = 0; i < image.rgba.size(); i += 4) {
    ASSERT_NEAR(image.rgba[i + 3], 0.5, 1e-6);
    ASSERT_NEAR(image.rgba[i], 0.5, 1e-6);
  }
}

TEST(SplatClosedForm, ANeedleDoesNotBreak) {
  // 1 m by 0 by 0 along the diagonal: 100,000 pixels long at this focal length, dilation alone
  // across. Across, the variance is exactly the dilation.
  Scene scene;
  const float s = 1.0f / std::sqrt(2.0f);
  scene.add({0, 0, 1}, {s, 0, 0, s, 0, 0, 0, 0, 0}, 0.9f,
            {tests::dc_of(1), tests::dc_of(1), tests::dc_of(1)});
  const FloatImage image = render(scene, front_camera(64, 64, 100000));
  LargestError error("alpha of a needle");
  for (uint32_t y = 0; y < 64; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      const double along = (x + 0.5 - 32 + y + 0.5 - 32) / std::sqrt(2.0),
                   across = (x - double(y)) / std::sqrt(2.0);
      const double alpha = 0.9f * std::exp(-0.5 * (across * across / 0.3 + along * along / 1e10));
      error.add(image.at(x, y)[3], alpha < kAlphaCut ? 0 : alpha);
    }
  }
  EXPECT_LE(error.largest(), 2e-6)
      << "the row's centre is a float of about 32 pixels: 2e-6 px over a deviation of 0.55 px";
}

TEST(SplatClosedForm, ExtremesOfOpacity) {
  const Camera camera = front_camera(33, 33, 50);
  for (const float opacity :
       {0.0f, std::nextafter(kAlphaCut, 0.0f), -1.0f, std::numeric_limits<float>::quiet_NaN(),
        std::numeric_limits<float>::infinity()}) {
    Scene scene;
    scene.add_ball({0, 0, 2}, 0.2f, opacity, {1, 1, 1});
    EXPECT_EQ(render(scene, camera).at(16, 16)[3], 0) << opacity;
  }
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.2f, kAlphaCut, {1, 1, 1});
  const FloatImage image = render(scene, camera);
  EXPECT_NEAR(image.at(16, 16)[3], kAlphaCut, 1e-7) << "at the cut counts";
  EXPECT_EQ(image.at(17, 16)[3], 0);
}

TEST(SplatClosedForm, WhatIsNotFiniteIsLeftOutOneByOne) {
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              inf = std::numeric_limits<float>::infinity();
  Scene clean;
  clean.add_ball({0, 0, 2}, 0.1f, 0.8f, {0.2f, 0.4f, 0.6f});
  Scene dirty;
  for (const float bad : {nan, inf, -inf}) {
    for (int k = 0; k < 3; ++k) {
      std::array<float, 3> place{0, 0, 1};
      place[k] = bad;
      dirty.add_ball(place, 0.1f, 0.8f, {1, 1, 1});
      std::array<float, 3> colour{1, 1, 1};
      colour[k] = bad;
      dirty.add_ball({0, 0, 1}, 0.1f, 0.8f, colour);
    }
    for (int k = 0; k < 9; ++k) {
      std::array<float, 9> factor{0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0.1f};
      factor[k] = bad;
      dirty.add({0, 0, 1}, factor, 0.8f, {0, 0, 0});
    }
  }
  dirty.add_ball({0, 0, 1}, 3e38f, 0.8f, {1, 1, 1});  // finite, but its covariance is not
  const size_t bad_count = dirty.opacity.size();
  dirty.add_ball({0, 0, 2}, 0.1f, 0.8f, {0.2f, 0.4f, 0.6f});
  const Camera camera = front_camera(33, 33, 50);
  const std::unique_ptr<Renderer> renderer = tests::make_renderer();
  const GaussianView view = dirty.view();
  const FloatImage image = render(*renderer, {.camera = camera, .gaussians = {&view, 1}});
  EXPECT_EQ(image.rgba, render(clean, camera).rgba);
  EXPECT_EQ(renderer->statistics().gaussians, bad_count + 1);
  EXPECT_EQ(renderer->statistics().visible, 1u);
}

TEST(SplatClosedForm, AHundredThousandTransparentLayers) {
  // Alpha 0.004 each, equal colour: 1 - 0.996^n, until the light falls below 1e-4 at layer 2,299.
  Scene scene;
  for (uint32_t i = 0; i < 100000; ++i)
    scene.add_ball({0, 0, 2.0f + 1e-5f * static_cast<float>(i)}, 5, 0.004f, {0.5f, 0.5f, 0.5f});
  const std::array<float, 4> centre = render(scene, front_camera(5, 5, 100)).at(2, 2);
  EXPECT_NEAR(centre[3], 1 - 1e-4, 2e-6);
  EXPECT_LE(centre[3], 1 - 1e-4f);
  EXPECT_NEAR(centre[0], 0.5, 1e-5);
}

TEST(SplatClosedForm, AThinLineOfLayersKeepsItsSum) {
  // Fewer layers than the stop: 500 of alpha 0.01 leave 0.99^500 of the light.
  Scene scene;
  for (uint32_t i = 0; i < 500; ++i)
    scene.add_ball({0, 0, 2.0f + 1e-3f * static_cast<float>(i)}, 50, 0.01f, {1, 1, 1});
  EXPECT_NEAR(render(scene, front_camera(3, 3, 100)).at(1, 1)[3], 1 - std::pow(0.99, 500), 3e-6);
}

TEST(SplatClosedForm, FarFromTheOriginOnlyTheViewMatters) {
  // The same scene 1,000 m away. Positions there are multiples of 6e-5 m: at 100 px / 2 m that is
  // 0.003 px.
  Scene here, there;
  here.add_ball({0.25f, 0, 2}, 0.125f, 0.8f, {1, 1, 1});
  there.add_ball({1000.25f, 0, 2}, 0.125f, 0.8f, {1, 1, 1});
  Camera camera = front_camera(64, 64, 100), moved = camera;
  moved.view_from_world[3] = -1000;
  const FloatImage a = render(here, camera), b = render(there, moved);
  LargestError error("alpha at 1,000 m");
  for (size_t i = 3; i < a.rgba.size(); i += 4) error.add(a.rgba[i], b.rgba[i]);
  EXPECT_LE(error.largest(), 1e-3);
}

TEST(SplatClosedForm, FieldsOfViewOf1And170Degrees) {
  for (const float fov_deg : {1.0f, 170.0f}) {
    const float focal = 32 / std::tan(fov_deg * 3.14159265f / 360);
    Scene scene;
    const float deviation = 2 * 5.0f / focal;  // 5 pixels at 2 m
    scene.add_ball({0, 0, 2}, deviation, 0.8f, {1, 1, 1});
    const FloatImage image = render(scene, front_camera(64, 64, focal));
    LargestError error(fov_deg == 1.0f ? "alpha at 1 degree" : "alpha at 170 degrees");
    for (uint32_t x = 0; x < 64; ++x) {
      const double dx = x + 0.5 - 32, alpha = 0.8f * std::exp(-0.5 * (dx * dx + 0.25) / 25.3);
      if (std::abs(alpha - kAlphaCut) > 1e-6)
        error.add(image.at(x, 32)[3], alpha < kAlphaCut ? 0 : alpha);
    }
    EXPECT_LE(error.largest(), 2e-6);
  }
}

TEST(SplatClosedForm, AntialiasedWeightIsThatOfTheGaussian) {
  // The integral of a ball's alpha over the image plane is opacity 2 pi (f s / z)^2, however small
  // it is beside a pixel; with the dilation alone a small one weighs 0.3 px^2 more.
  for (const float deviation_px : {0.2f, 0.5f, 1.0f, 3.0f}) {
    Scene scene;
    scene.add_ball({0.003f, 0.007f, 2}, deviation_px * 2 / 100, 0.5f, {1, 1, 1});
    const auto weight = [&](bool antialiased) {
      const FloatImage image = render(scene, front_camera(64, 64, 100),
                                      {.alpha_cut = 1e-6f, .antialiased = antialiased});
      double sum = 0;
      for (size_t i = 3; i < image.rgba.size(); i += 4) sum += image.rgba[i];
      return sum;
    };
    const double variance = double(deviation_px) * deviation_px, unit = 0.5 * 2 * M_PI;
    EXPECT_NEAR(weight(true), unit * variance, 0.02 * unit * variance) << deviation_px;
    EXPECT_NEAR(weight(false), unit * (variance + 0.3), 0.02 * unit * (variance + 0.3))
        << deviation_px;
  }
}

}  // namespace
}  // namespace figurine::splat_closed_form_test
