// The pull on Gaussians from mask that a picture leaves uncovered: where the answer is known, its
// gradient against finite differences, and what it does not touch.
#include "toolchain/train/standoff.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/toolchain/train/small_capture.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::train::standoff_test {
namespace {

constexpr uint32_t kSize = 64;

// Looks along +z from the origin; a metre is 64 pixels at a depth of one.
Camera straight_camera() {
  return {.width_px = kSize,
          .height_px = kSize,
          .fx_px = 64,
          .fy_px = 64,
          .cx_px = 32,
          .cy_px = 32,
          .near_m = 0.2f};
}

struct Picture {
  Camera camera = straight_camera();
  std::vector<float> alpha = std::vector<float>(kSize * kSize, 0.0f), mask = alpha;
  StandoffView view() const {
    return {.camera = &camera,
            .crop = {0, 0, kSize, kSize},
            .alpha = alpha.data(),
            .mask = mask.data()};
  }
};

TEST(Standoff, PullsTheNearestCentreStraightToTheUncoveredPixelsRay) {
  Picture picture;
  picture.mask[32 * kSize + 48] = 1;  // ray through (16.5/64, 0.5/64, 1)
  const std::vector<float> centres{0, 0.0078125f, 1, -0.4f, 0, 1};
  std::vector<double> gradient(6, 0.0);
  const double loss = standoff_loss(picture.view(), centres, {.weight = 1}, 1, gradient);
  const double tangent = 16.5 / 64, rise = 0.5 / 64;
  const double distance =
      tangent * std::sqrt(1 + rise * rise) / std::sqrt(1 + tangent * tangent + rise * rise);
  EXPECT_NEAR(loss, (distance - 0.012 - 0.01) / (0.05 * kSize * kSize), 1e-6 / kSize);
  // Down the gradient is towards the ray: to +x and, because the ray leans, to -z; of length one
  // pixel's share.
  EXPECT_LT(gradient[0], 0);
  EXPECT_GT(gradient[2], 0);
  EXPECT_NEAR(std::hypot(gradient[0], gradient[1], gradient[2]) * 0.05 * kSize * kSize, 1, 1e-6);
  for (size_t k = 3; k < 6; ++k) EXPECT_EQ(gradient[k], 0) << "the farther centre";
}

TEST(Standoff, LeavesCoveredPixelsSoftEdgesAndCentresWithinReachAlone) {
  Picture picture;
  for (size_t pixel = 0; pixel < picture.mask.size(); ++pixel) {
    picture.mask[pixel] = 1;
    picture.alpha[pixel] = 0.8f;
  }
  const std::vector<float> centres{0, 0, 1};
  std::vector<double> gradient(3, 0.0);
  EXPECT_EQ(standoff_loss(picture.view(), centres, {}, 1, gradient), 0);
  std::fill(picture.mask.begin(), picture.mask.end(), 0.0f);
  picture.alpha[32 * kSize + 32] = 0;
  picture.mask[32 * kSize + 32] = 1;  // 0.7 px of 1.6 cm beside the centre
  EXPECT_EQ(standoff_loss(picture.view(), centres, {}, 1, gradient), 0);
  EXPECT_EQ(gradient, (std::vector<double>{0, 0, 0}));
}

TEST(Standoff, FindsTheNearestOfManyCentresWhereverTheyLie) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-1.5f, 1.5f), depth(-0.5f, 3);
  std::vector<float> centres;
  for (int i = 0; i < 300; ++i)
    centres.insert(centres.end(), {place(random), place(random), depth(random)});
  for (uint32_t pixel = 0; pixel < kSize * kSize; pixel += 37) {
    Picture picture;
    picture.mask[pixel] = 1;
    std::vector<double> gradient(centres.size(), 0.0);
    standoff_loss(picture.view(), centres, {.reach_m = 0}, 1, gradient);
    const double x = pixel % kSize + 0.5, y = pixel / kSize + 0.5;
    size_t nearest = 0;
    double best = 1e30;
    for (size_t i = 0; i < centres.size() / 3; ++i) {
      const double z = centres[3 * i + 2];
      if (z <= 0.2f) continue;
      const double distance =
          std::hypot(64 * centres[3 * i] / z + 32 - x, 64 * centres[3 * i + 1] / z + 32 - y);
      if (distance < best) best = distance, nearest = i;
    }
    for (size_t i = 0; i < centres.size() / 3; ++i)
      EXPECT_EQ(gradient[3 * i] != 0, i == nearest) << pixel << " " << i;
  }
}

TEST(Standoff, GradientEqualsFiniteDifferences) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> depth(1, 3), unit(0, 1);
  Picture picture;
  picture.camera = value_or_throw(
      make_orbit_camera({.azimuth_deg = 40, .elevation_deg = 20, .distance_m = 2}, kSize, kSize),
      "camera");
  const Camera& camera = picture.camera;
  // Centres 16 pixels apart at any depth; around each a patch that stays its own while it moves a
  // thirtieth of a pixel.
  std::vector<float> centres;
  for (uint32_t y = 8; y < kSize; y += 16) {
    for (uint32_t x = 8; x < kSize; x += 16) {
      for (uint32_t pixel = (y - 5) * kSize + x - 5; pixel < (y + 5) * kSize; ++pixel) {
        if (pixel % kSize >= x - 5 && pixel % kSize < x + 5)
          picture.mask[pixel] = unit(random), picture.alpha[pixel] = 0.2f * unit(random);
      }
      const float z = depth(random);
      const float view[3] = {
          (float(x) - camera.cx_px) / camera.fx_px * z - camera.view_from_world[3],
          (float(y) - camera.cy_px) / camera.fy_px * z - camera.view_from_world[7],
          z - camera.view_from_world[11]};
      const float* m = camera.view_from_world.data();
      for (int k = 0; k < 3; ++k)
        centres.push_back(m[k] * view[0] + m[4 + k] * view[1] + m[8 + k] * view[2]);
    }
  }
  std::vector<double> gradient(centres.size(), 0.0), unused(centres.size());
  standoff_loss(picture.view(), centres, {}, 1, gradient);
  double largest = 0, scale = 0;
  for (double value : gradient) scale = std::max(scale, std::fabs(value));
  for (size_t i = 0; i < centres.size(); ++i) {
    const float at = centres[i], step = 1.0f / 2048;
    centres[i] = at + step;
    const double above = standoff_loss(picture.view(), centres, {}, 1, unused), high = centres[i];
    centres[i] = at - step;
    const double below = standoff_loss(picture.view(), centres, {}, 1, unused), low = centres[i];
    centres[i] = at;
    largest = std::max(largest, std::fabs((above - below) / (high - low) - gradient[i]) / scale);
  }
  std::printf("largest error, stand-off against differences: %.2g of the largest gradient\n",
              largest);
  EXPECT_LT(largest, 2e-3);  // Huber's bends, within a step
}

TEST(Standoff, OffsetsTakeTheGradientThroughTheSkinningAndOthersNone) {
  const PackageFile package = open_package(testing_tools::small_capture().body, PackageKind::kBody);
  const Body& body = package.package.body();
  const dataset::Dataset data =
      dataset::Dataset::open(testing_tools::small_capture().data, {.body = &body});
  const AvatarModel model(body, data.shape(), preset_settings("nano"), false);
  const PosedBody posed = model.pose(model.from_capture(data.frames()[3]).view());
  const model::HeadFrame frame = model.head_frame(posed);
  const uint32_t channels = head_channels(0);
  std::vector<float> head(size_t(body.texel_count()) * channels, 0.0f), ours = head, theirs = head;
  // The head's own backward pass, told of position gradients alone, is the reference.
  model::GaussianBuffer<float> gradients;
  gradients.resize(body.texel_count(), 0);
  for (std::vector<float>* values :
       {&gradients.position_m, &gradients.covariance_factor, &gradients.opacity, &gradients.sh})
    std::fill(values->begin(), values->end(), 0.0f);
  std::vector<double> pulls(3 * size_t(body.texel_count()), 0.0);
  for (size_t i = 0; i < pulls.size(); i += 21) {
    pulls[i] = 0.25 * double(i % 7) - 0.5;
    gradients.position_m[i] = float(pulls[i]);
  }
  model::decode_head_backward(frame, head.data(), gradients, 1, theirs.data());
  add_offset_gradient(frame, pulls, ours.data());
  for (size_t i = 0; i < ours.size(); ++i) EXPECT_NEAR(ours[i], theirs[i], 1e-7) << i;
}

TEST(Standoff, FadesBeforeTheSecondHalf) {
  EXPECT_EQ(standoff_fade(0), 1);
  EXPECT_EQ(standoff_fade(0.3), 1);
  EXPECT_NEAR(standoff_fade(0.4), 0.5, 1e-12);
  EXPECT_EQ(standoff_fade(0.5), 0);
  EXPECT_EQ(standoff_fade(1), 0);
}

}  // namespace
}  // namespace figurine::train::standoff_test
