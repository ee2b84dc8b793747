// Every gradient of the picture against finite differences, in double; and the float instance
// against the double one.
#include <gtest/gtest.h>

#include <cstdio>
#include <limits>

#include "tests/toolchain/model/gradient_check.h"

namespace figurine::gradient_test {
namespace {

// Central differences with these steps are good to about 1e-6 of the largest gradient (rounding of
// the image over the step).
constexpr double kTolerance = 1e-4;

void expect_small(const testing::GradientErrors& errors, uint32_t degree) {
  for (const auto& [kind, error] : errors) {
    std::printf(
        "SH degree %u, %-18s largest relative error %.3g of %llu values (%llu with a smaller "
        "step)\n",
        degree, kind.c_str(), error.largest_relative,
        static_cast<unsigned long long>(error.checked),
        static_cast<unsigned long long>(error.refined));
    EXPECT_LE(error.refined, error.checked / 100) << kind;
    EXPECT_GT(error.largest_gradient, 0) << kind;
    EXPECT_LT(error.largest_relative, kTolerance) << kind;
  }
}

TEST(SplatGradients, EqualFiniteDifferencesForEveryShDegree) {
  for (uint32_t degree = 0; degree <= kMaxShDegree; ++degree)
    expect_small(testing::check_splat_gradients(degree, 60), degree);
}

// Deviations are around a pixel, so that what the dilation takes from opacities changes steeply.
TEST(SplatGradients, AntialiasedEqualFiniteDifferences) {
  expect_small(testing::check_splat_gradients(0, 60, true), 0);
}

TEST(HeadGradients, EqualFiniteDifferencesThroughSkinningAndSplatting) {
  for (uint32_t degree : {0u, 3u}) expect_small(testing::check_head_gradients(degree), degree);
}

// Extents from nothing to that of the Gaussians themselves, which are of 4 to 9 cm.
TEST(HeadGradients, WithFiltersEqualFiniteDifferences) {
  expect_small(testing::check_head_gradients(0, {.smallest_extent_m = 0.08f}), 0);
  expect_small(testing::check_head_gradients(0, {.smallest_extent_m = 0.08f, .antialiased = true}),
               0);
}

TEST(SplatGradients, StoppedPixelsAndClampedAlphasEqualFiniteDifferences) {
  // Nearly opaque, overlapping: alphas at 0.99 and pixels that stop early. A value that sits on a
  // jump is not a gradient's to follow: at most a few may.
  model::GaussianBuffer<double> gaussians =
      testing::to_buffer<double>(testing::random_gaussians({.count = 150,
                                                            .scale_m = 0.12,
                                                            .extent_m = 0.5,
                                                            .low_opacity = 0.97,
                                                            .high_opacity = 1.0,
                                                            .seed = 77}));
  const Camera camera = testing::test_camera(48);
  const model::PixelRect crop{0, 0, 48, 48};
  model::Splatter<double> splatter({.threads = 1});
  const std::function<std::vector<double>()> render = [&] {
    return testing::splat(splatter, gaussians, camera, crop);
  };
  const std::vector<double> weights = testing::random_weights(4 * 48 * 48);
  const std::vector<double> image = render();
  EXPECT_GT(*std::max_element(image.begin() + 3 * 48 * 48, image.end()), 0.999);
  model::GaussianBuffer<double> gradients;
  gradients.resize(gaussians.count, 0);
  splatter.backward(image.data(), weights.data(), gradients.gradients());
  std::vector<testing::Checked> checked;
  for (size_t i = 0; i < gaussians.position_m.size(); ++i) {
    checked.push_back(
        {gradients.position_m[i],
         testing::central_difference(gaussians.position_m[i], 1e-7, weights, render)});
  }
  double largest = 0;
  for (const testing::Checked& v : checked) largest = std::max(largest, std::abs(v.analytic));
  int jumps = 0;
  double worst = 0;
  for (const testing::Checked& v : checked) {
    const double relative = std::abs(v.analytic - v.numeric) /
                            std::max({std::abs(v.analytic), std::abs(v.numeric), 1e-3 * largest});
    if (relative > 1e-3)
      ++jumps;
    else
      worst = std::max(worst, relative);
  }
  std::printf("%d of %zu values on a jump, largest relative error of the others %.3g\n", jumps,
              checked.size(), worst);
  EXPECT_LE(jumps, 4);
}

TEST(SplatGradients, FloatEqualsDouble) {
  const oracle::Gaussians scene =
      testing::random_gaussians({.count = 4000, .sh_degree = 1, .seed = 21});
  const Camera camera = testing::test_camera(200);
  const model::PixelRect crop{0, 0, 200, 200};
  model::Splatter<double> exact({.threads = 2});
  model::Splatter<float> fast({.threads = 2});
  const auto wide = testing::to_buffer<double>(scene);
  const auto narrow = testing::to_buffer<float>(scene);
  const std::vector<double> wide_image = testing::splat(exact, wide, camera, crop),
                            weights = testing::random_weights(wide_image.size());
  const std::vector<float> narrow_image = testing::splat(fast, narrow, camera, crop),
                           narrow_weights(weights.begin(), weights.end());
  model::GaussianBuffer<double> wide_gradients;
  model::GaussianBuffer<float> narrow_gradients;
  wide_gradients.resize(scene.count, scene.sh_degree);
  narrow_gradients.resize(scene.count, scene.sh_degree);
  exact.backward(wide_image.data(), weights.data(), wide_gradients.gradients());
  fast.backward(narrow_image.data(), narrow_weights.data(), narrow_gradients.gradients());
  const auto relative_rms = [](const std::vector<double>& a, const std::vector<float>& b) {
    double error = 0, size = 0;
    for (size_t i = 0; i < a.size(); ++i)
      error += (a[i] - double(b[i])) * (a[i] - double(b[i])), size += a[i] * a[i];
    return std::sqrt(error / size);
  };
  const double errors[4] = {
      relative_rms(wide_gradients.position_m, narrow_gradients.position_m),
      relative_rms(wide_gradients.covariance_factor, narrow_gradients.covariance_factor),
      relative_rms(wide_gradients.opacity, narrow_gradients.opacity),
      relative_rms(wide_gradients.sh, narrow_gradients.sh)};
  std::printf("relative RMS of position, factor, opacity, SH: %.3g %.3g %.3g %.3g\n", errors[0],
              errors[1], errors[2], errors[3]);
  // Most of it is single pixels that cross the alpha cut in one precision and not in the other.
  for (double error : errors) EXPECT_LT(error, 2e-2);
}

TEST(HeadGradients, HostileOutputsGiveFiniteGradients) {
  const testing::SyntheticBody capsule(16, 14);
  const std::vector<Affine> transforms = capsule.bent();
  model::HeadFrame frame{.body = &capsule.body,
                         .texel_position_m = capsule.position,
                         .world_from_rest = transforms,
                         .decoding = {.sh_degree = 1}};
  constexpr uint32_t kChannels = head_channels(1);
  std::vector<float> head(size_t(capsule.body.texel_count()) * kChannels, 0.1f);
  const auto at = [&](uint32_t texel) { return &head[size_t(texel) * kChannels]; };
  at(100)[10] = 1e4f;
  at(101)[10] = -1e4f;
  at(102)[3] = 1e4f;  // scale beyond the clamp
  at(103)[4] = -1e4f;
  at(104)[6] = -1;  // the zero quaternion
  at(104)[7] = at(104)[8] = at(104)[9] = 0;
  at(105)[0] = std::numeric_limits<float>::quiet_NaN();
  at(106)[7] = std::numeric_limits<float>::infinity();
  at(107)[10] = std::numeric_limits<float>::quiet_NaN();
  at(108)[12] = std::numeric_limits<float>::infinity();
  at(109)[2] = 1e30f;
  std::vector<float> smallest(capsule.body.texel_count(), 1e-9f);
  smallest[102] = smallest[103] = 0.1f;
  frame.smallest_extent_m = smallest;
  const Camera camera = *make_orbit_camera({.distance_m = 3, .target_m = {0, 0.87f, 0}}, 64, 64);
  model::Splatter<float> splatter({.threads = 1});
  model::GaussianBuffer<float> gaussians, gradients;
  decode_head(frame, head.data(), 1, gaussians);
  EXPECT_EQ(gaussians.opacity[100], 1);
  EXPECT_EQ(gaussians.opacity[101], 0);
  const std::vector<float> image = testing::splat(splatter, gaussians, camera, {0, 0, 64, 64});
  const std::vector<float> weights(image.size(), 1.0f);
  gradients.resize(gaussians.count, 1);
  splatter.backward(image.data(), weights.data(), gradients.gradients());
  std::vector<float> head_gradient(head.size());
  decode_head_backward(frame, head.data(), gradients, 1, head_gradient.data());
  for (size_t i = 0; i < head.size(); ++i)
    ASSERT_TRUE(std::isfinite(head_gradient[i]))
        << "texel " << i / kChannels << " channel " << i % kChannels;
}

TEST(HeadDecoding, WidensToTheSmallestExtentAsTheDefinitionDoes) {
  const testing::SyntheticBody capsule(16, 14);
  const std::vector<Affine> transforms = capsule.bent();
  const uint32_t texels = capsule.body.texel_count();
  std::vector<float> smallest(texels);
  for (uint32_t i = 0; i < texels; ++i) smallest[i] = i % 3 == 0 ? 0 : 0.001f * float(i % 50);
  model::HeadFrame frame{.body = &capsule.body,
                         .texel_position_m = capsule.position,
                         .world_from_rest = transforms,
                         .decoding = {}};
  std::mt19937 random(6);
  std::normal_distribution<float> normal;
  std::vector<float> head(size_t(texels) * 14);
  for (float& value : head) value = normal(random);
  model::GaussianBuffer<float> plain, widened;
  decode_head(frame, head.data(), 1, plain);
  frame.smallest_extent_m = smallest;
  decode_head(frame, head.data(), 2, widened);
  EXPECT_EQ(plain.position_m, widened.position_m);
  for (uint32_t i = 0; i < texels; ++i) {
    float opacity = plain.opacity[i];
    for (int j = 0; j < 3; ++j) {
      const float own = 0.6f * capsule.spacing[i] * std::exp(head[size_t(i) * 14 + 3 + j]),
                  wide = std::sqrt(own * own + smallest[i] * smallest[i]);
      if (smallest[i] > 0) opacity *= own / wide;
      // F = (A R) S: a column's ratio is that of its scales, but for one rounding of each.
      for (int r = 0; r < 3; ++r) {
        const size_t at = 9 * size_t(i) + 3 * r + j;
        ASSERT_NEAR(widened.covariance_factor[at],
                    plain.covariance_factor[at] * double(smallest[i] > 0 ? wide / own : 1),
                    4e-7 * std::abs(widened.covariance_factor[at]));
      }
    }
    ASSERT_EQ(widened.opacity[i], opacity);
  }
}

TEST(HeadDecoding, EqualsTheSharedArithmetic) {
  // Against figurine::blend, transform_point and rotation_from_quaternion, which the runtime uses.
  const testing::SyntheticBody capsule(16, 14);
  const std::vector<Affine> transforms = capsule.bent();
  const model::HeadFrame frame{.body = &capsule.body,
                               .texel_position_m = capsule.position,
                               .world_from_rest = transforms,
                               .decoding = {}};
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  std::vector<float> head(size_t(capsule.body.texel_count()) * 14);
  for (float& value : head) value = normal(random);
  model::GaussianBuffer<float> gaussians;
  decode_head(frame, head.data(), 2, gaussians);
  for (uint32_t i = 0; i < capsule.body.texel_count(); ++i) {
    const float* h = &head[size_t(i) * 14];
    const Affine m = blend(transforms, &capsule.texel_joints[i * kSkinInfluences],
                           &capsule.weights[i * kSkinInfluences]);
    float canonical[3], quaternion[4];
    for (int k = 0; k < 3; ++k) canonical[k] = capsule.position[3 * i + k] + 0.05f * h[k];
    for (int k = 0; k < 4; ++k) quaternion[k] = (k == 0 ? 1.0f : 0.0f) + h[6 + k];
    const std::array<float, 3> position = transform_point(m, canonical);
    const std::array<float, 9> rotation = rotation_from_quaternion(quaternion);
    for (int r = 0; r < 3; ++r) {
      ASSERT_EQ(gaussians.position_m[3 * i + r], position[r]);
      for (int j = 0; j < 3; ++j) {
        const float rotated = m.m[4 * r] * rotation[j] + m.m[4 * r + 1] * rotation[3 + j] +
                              m.m[4 * r + 2] * rotation[6 + j];
        const float scale = 0.6f * capsule.spacing[i] * std::exp(h[3 + j]);
        ASSERT_EQ(gaussians.covariance_factor[9 * i + 3 * r + j], rotated * scale);
      }
    }
  }
}

}  // namespace
}  // namespace figurine::gradient_test
