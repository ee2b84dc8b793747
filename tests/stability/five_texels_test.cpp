// The renderer's half of the five texels (docs/numerics.md): head to Gaussians, projection and
// pixels, from packages to an image, against float64. The half that formats computes is held by
// tests/formats/posing_golden_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "figurine/renderer.h"
#include "tests/golden/posing/five_texels_packages.h"
#include "tests/largest_error.h"
#include "tests/oracle/splat_oracle.h"

namespace figurine {
namespace {

using golden::FiveTexels;
using golden::FiveTexelsPackages;
using golden::Json;

class FiveTexelsRendering : public testing::Test {
 protected:
  FiveTexelsRendering() : packages_(example_), renderer_(std::move(Renderer::create({})).value()) {
    avatar_ = renderer_->add_avatar(packages_.avatar(), packages_.body()).value();
  }
  const Json& texel(size_t i) const { return example_.expected["texels"][i]; }

  FiveTexels example_;
  FiveTexelsPackages packages_;
  std::unique_ptr<Renderer> renderer_;
  AvatarId avatar_{};
};

TEST_F(FiveTexelsRendering, GaussiansAreDecodedAndSkinnedAsByHand) {
  const Result<GaussianView> view = renderer_->pose_avatar(avatar_, example_.pose);
  ASSERT_TRUE(view.ok()) << view.status().message();
  ASSERT_EQ(view->count, 5u);
  LargestError centre("centre [m]"), factor("factor, relative to the Gaussian's size"),
      opacity("opacity"), colour("SH coefficient");
  for (size_t i = 0; i < 5; ++i) {
    const Json& expected = texel(i)["gaussian"];
    const double size = expected["scale_m"][0].get<double>() +
                        expected["scale_m"][1].get<double>() + expected["scale_m"][2].get<double>();
    for (size_t k = 0; k < 3; ++k) centre.add(view->position_m[3 * i + k], expected["centre_m"][k]);
    for (size_t k = 0; k < 9; ++k)
      factor.add(
          (view->covariance_factor[9 * i + k] - expected["factor"][k / 3][k % 3].get<double>()) /
          size);
    opacity.add(view->opacity[i], expected["opacity"]);
    for (size_t k = 0; k < 3; ++k) colour.add(view->sh[3 * i + k], expected["sh"][k]);
  }
  EXPECT_LE(centre.largest(), 1e-6);
  EXPECT_LE(factor.largest(), 4e-6);
  EXPECT_LE(opacity.largest(), 1e-6);
  EXPECT_LE(colour.largest(), 4e-6);
}

TEST_F(FiveTexelsRendering, TheOracleProjectsThemAsByHand) {
  // Closes the triangle: the brute-force oracle that judges the renderers is itself held against
  // the page.
  oracle::Gaussians gaussians{.count = 5,
                              .sh_degree = 0,
                              .position_m = {},
                              .covariance_factor = {},
                              .opacity = {},
                              .sh = {}};
  for (size_t i = 0; i < 5; ++i) {
    const Json& g = texel(i)["gaussian"];
    golden::flatten(g["centre_m"], gaussians.position_m);
    golden::flatten(g["factor"], gaussians.covariance_factor);
    golden::flatten(g["sh"], gaussians.sh);
    gaussians.opacity.push_back(g["opacity"]);
  }
  LargestError error("oracle's projection"), pixels("oracle's pixels");
  for (size_t i = 0; i < 5; ++i) {
    const oracle::Splat splat = oracle::project(gaussians, i, example_.camera);
    const Json& expected = texel(i)["projection"];
    ASSERT_TRUE(splat.visible);
    for (size_t k = 0; k < 2; ++k) error.add(splat.mean_px[k], expected["mean_px"][k]);
    error.add(splat.a, expected["covariance_px2"][0]);
    error.add(splat.b, expected["covariance_px2"][1]);
    error.add(splat.c, expected["covariance_px2"][2]);
    error.add(splat.determinant, expected["determinant_px4"]);
    for (size_t k = 0; k < 3; ++k) error.add(splat.rgb[k], expected["colour"][k]);
  }
  const oracle::Image image = oracle::render(gaussians, example_.camera);
  for (const Json& expected : example_.expected["pixels"]) {
    const size_t pixel =
        expected["pixel"][1].get<size_t>() * image.width + expected["pixel"][0].get<size_t>();
    for (size_t k = 0; k < 3; ++k)
      pixels.add(image.rgb[3 * pixel + k], expected["premultiplied_colour"][k]);
    pixels.add(image.alpha(pixel), expected["alpha"]);
  }
  EXPECT_LE(error.largest(),
            1e-6);  // the constants of gaussian.h are floats (SH0, 1/255): 6e-8 of them
  EXPECT_LE(pixels.largest(), 1e-7);
}

TEST_F(FiveTexelsRendering, PixelsAreAsByHand) {
  const Camera& camera = example_.camera;
  std::vector<float> rgba(size_t(camera.width_px) * camera.height_px * 4);
  const FrameAvatar seen[] = {{.avatar = avatar_, .pose = example_.pose}};
  const Status status = renderer_->render(
      {.camera = camera, .avatars = seen, .gaussians = {}, .background = {}, .splat = {}},
      {.pixels = rgba.data(),
       .stride_bytes = 16 * size_t(camera.width_px),
       .format = PixelFormat::kRgbaF32});
  ASSERT_TRUE(status.ok()) << status.message();
  LargestError error("pixels, premultiplied");
  size_t covered = 0;
  for (const Json& expected : example_.expected["pixels"]) {
    const float* pixel = &rgba[4 * (expected["pixel"][1].get<size_t>() * camera.width_px +
                                    expected["pixel"][0].get<size_t>())];
    for (size_t k = 0; k < 3; ++k)
      error.add(pixel[k] * pixel[3], expected["premultiplied_colour"][k]);
    error.add(pixel[3], expected["alpha"]);
    covered += pixel[3] > 0;
  }
  EXPECT_EQ(covered, 4u);
  EXPECT_LE(error.largest(), 1e-5);
}

}  // namespace
}  // namespace figurine
