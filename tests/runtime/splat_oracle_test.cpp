// The renderer against the float64 brute-force oracle, which shares no code with it: random clouds,
// off-centre principal points, every SH degree.
#include "oracle/splat_oracle.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "largest_error.h"
#include "runtime/splat_scene.h"

namespace figurine::splat_oracle_test {
namespace {

using tests::FloatImage;
using tests::make_random_scene;
using tests::Scene;

struct Comparison {
  double foreground_psnr_db = 0;
  double largest_inside = 0;    // where no threshold may have been decided otherwise
  double largest_doubtful = 0;  // elsewhere
  double doubtful = 0;          // share of such pixels
  double flipped = 0;           // share of pixels that differ by more than the tight bound
};

// Float rounding alone: some tens of contributions a pixel, each with a power whose error is some
// 1e-6, and colours of up to 3.
constexpr double kTight = 2e-5;

Comparison compare(const Scene& scene, const Camera& camera, const char* what,
                   const SplatOptions& splat = {}) {
  const FloatImage image = tests::render(scene, camera, splat);
  const oracle::Image truth =
      oracle::render(oracle::from_view(scene.view()), camera,
                     {.alpha_cut = splat.alpha_cut, .antialiased = splat.antialiased == true});
  std::vector<float> premultiplied = image.rgba;
  for (size_t i = 0; i < premultiplied.size(); i += 4) {
    for (int c = 0; c < 3; ++c) premultiplied[i + c] *= premultiplied[i + 3];
  }
  Comparison comparison;
  comparison.foreground_psnr_db = oracle::foreground_psnr_db<float>(truth, premultiplied);
  LargestError inside(what);
  size_t doubtful = 0, flipped = 0;
  const size_t pixels = truth.transmittance.size();
  for (size_t p = 0; p < pixels; ++p) {
    double largest = std::abs(premultiplied[4 * p + 3] - truth.alpha(p));
    for (int c = 0; c < 3; ++c)
      largest = std::max(largest, std::abs(premultiplied[4 * p + c] - truth.rgb[3 * p + c]));
    flipped += largest > kTight;
    if (truth.doubtful[p] == 0) {
      inside.add(largest);
    } else {
      ++doubtful;
      comparison.largest_doubtful = std::max(comparison.largest_doubtful, largest);
    }
  }
  comparison.largest_inside = inside.largest();
  comparison.doubtful = static_cast<double>(doubtful) / static_cast<double>(pixels);
  comparison.flipped = static_cast<double>(flipped) / static_cast<double>(pixels);
  std::printf(
      "%s: foreground PSNR %.1f dB; %.2g of the pixels doubtful (largest error %.2g), "
      "%.2g beyond the tight bound\n",
      what, comparison.foreground_psnr_db, comparison.doubtful, comparison.largest_doubtful,
      comparison.flipped);
  return comparison;
}

// Inside, rounding alone. A contribution at a threshold may be taken on one side and not on the
// other: the error is then up to the cut times a colour of up to 3 or so. Such pixels are few, and
// most of them are decided alike.
void expect_close(const Comparison& comparison, double alpha_cut = kAlphaCut) {
  EXPECT_LE(comparison.largest_inside, kTight);
  EXPECT_LE(comparison.largest_doubtful, 3 * alpha_cut + kTight);
  EXPECT_LE(comparison.doubtful, 0.01);
  EXPECT_LE(comparison.flipped, 2e-4);
  EXPECT_GE(comparison.foreground_psnr_db, 100);
}

TEST(SplatOracle, TheOracleItselfLeavesOutNothingThatIsSeen) {
  Scene scene = make_random_scene(300, 0, 80);
  tests::Random random(81);
  for (int i = 0; i < 60; ++i) {  // needles and discs, some of them across the whole picture
    const float quaternion[4] = {random.normal(), random.normal(), random.normal(),
                                 random.normal()};
    std::array<float, 9> factor = rotation_from_quaternion(quaternion);
    const float scale[3] = {random.uniform(0.1f, 4), random.uniform(0, 1) < 0.5f ? 1e-4f : 1.0f,
                            1e-6f};
    for (int k = 0; k < 9; ++k) factor[k] *= scale[k % 3];
    scene.add({random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4)}, factor,
              i % 3 == 0 ? 1.0001f * static_cast<float>(kAlphaCut) : random.uniform(0.01f, 1),
              {1, 1, 1});
  }
  const Camera camera = tests::front_camera(61, 53, 50);
  const oracle::Gaussians gaussians = oracle::from_view(scene.view());
  const oracle::Image brief = oracle::render(gaussians, camera),
                      whole = oracle::render(gaussians, camera, {.skip_far_pixels = false});
  EXPECT_EQ(brief.rgb, whole.rgb);
  EXPECT_EQ(brief.transmittance, whole.transmittance);
  EXPECT_EQ(brief.doubtful, whole.doubtful);
}

TEST(SplatOracle, EveryShDegree) {
  for (uint32_t degree = 0; degree <= 3; ++degree) {
    const std::string what = "2,000 Gaussians, SH degree " + std::to_string(degree);
    expect_close(compare(make_random_scene(2000, degree, 10 + degree),
                         tests::front_camera(160, 120, 130), what.c_str()));
  }
}

TEST(SplatOracle, TwentyThousandGaussians) {
  expect_close(compare(make_random_scene(20000, 3, 20), tests::front_camera(256, 256, 220),
                       "20,000 Gaussians, SH degree 3"));
}

TEST(SplatOracle, OffCentrePrincipalPointAndUnequalFocals) {
  Camera camera = tests::front_camera(150, 110, 120);
  camera.cx_px = 20.25f;
  camera.cy_px = 130;  // outside the image
  camera.fy_px = 150;
  expect_close(compare(make_random_scene(3000, 1, 30), camera, "off-centre principal point"));
}

TEST(SplatOracle, TurnedAndMovedCamera) {
  const Result<Camera> camera = make_orbit_camera({.azimuth_deg = 130,
                                                   .elevation_deg = 35,
                                                   .distance_m = 3,
                                                   .vertical_fov_deg = 60,
                                                   .target_m = {0, 0.2f, 3}},
                                                  140, 140);
  ASSERT_TRUE(camera.ok());
  expect_close(compare(make_random_scene(4000, 3, 40), *camera, "orbit camera inside the cloud"));
}

TEST(SplatOracle, OtherAlphaCuts) {
  for (const float cut : {1.0f / 16, 1e-3f}) {
    const std::string what = "alpha cut " + std::to_string(cut);
    const Comparison comparison =
        compare(make_random_scene(2000, 0, 50), tests::front_camera(128, 128, 110), what.c_str(),
                {.alpha_cut = cut});
    expect_close(comparison, cut);
  }
}

TEST(SplatOracle, Antialiased) {
  // From Gaussians of many pixels down to a hundredth of one.
  for (const float focal_px : {220.0f, 40.0f, 4.0f}) {
    const std::string what = "antialiased, focal length " + std::to_string(int(focal_px));
    expect_close(compare(make_random_scene(4000, 0, 55), tests::front_camera(128, 128, focal_px),
                         what.c_str(), {.antialiased = true}));
  }
}

TEST(SplatOracle, ImageSizesThatAreNoMultipleOfATile) {
  for (const uint32_t size : {1u, 31u, 33u, 65u}) {
    const std::string what = std::to_string(size) + " pixels a side";
    const Comparison comparison =
        compare(make_random_scene(500, 0, 60 + size),
                tests::front_camera(size, size, 0.8f * static_cast<float>(size)), what.c_str());
    expect_close(comparison);
  }
}

TEST(SplatOracle, TheCropOfAnImageIsThatPartOfIt) {
  // Moving the principal point by whole tiles or by 7 pixels shifts the picture; up to the
  // Jacobian's clamp nothing else may change.
  Scene scene;
  tests::Random random(70);
  for (int i = 0; i < 300; ++i) {
    scene.add_ball({random.uniform(-0.5f, 0.5f), random.uniform(-0.5f, 0.5f), random.uniform(2, 3)},
                   random.uniform(0.005f, 0.05f), random.uniform(0.1f, 1),
                   {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)});
  }
  const Camera whole = tests::front_camera(128, 128, 128);
  const FloatImage full = tests::render(scene, whole);
  for (const uint32_t shift : {7u, 32u}) {
    Camera part = whole;
    part.width_px = 64;
    part.cx_px -= static_cast<float>(shift);
    const FloatImage crop = tests::render(scene, part);
    LargestError error("crop");
    for (uint32_t y = 0; y < 128; ++y) {
      for (uint32_t x = 0; x < 64; ++x) {
        for (int c = 0; c < 4; ++c)
          error.add(crop.at(x, y)[c] * (c < 3 ? crop.at(x, y)[3] : 1),
                    full.at(x + shift, y)[c] * (c < 3 ? full.at(x + shift, y)[3] : 1));
      }
    }
    EXPECT_LE(error.largest(), 1.5 / 255) << "a flip at the cut at most";
  }
}

}  // namespace
}  // namespace figurine::splat_oracle_test
