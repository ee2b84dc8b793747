// Shape directions, maps and Fourier channels (formats/src/body.cpp) beyond what the five texels
// cover.
#include "figurine/body.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/golden/posing/five_texels.h"
#include "tests/largest_error.h"

namespace figurine::body_test {
namespace {

using golden::FiveTexels;

TEST(ShapeBody, NoCoefficientsGiveTheMeanTemplateToTheBit) {
  const FiveTexels example;
  std::vector<float> joints(example.joints.size()), texels(example.positions.size());
  shape_body(example.body, {}, joints, texels);
  EXPECT_EQ(joints, example.joints);
  EXPECT_EQ(texels, example.positions);
}

TEST(PoseMaps, MovingTheRootMovesNothingInTheMaps) {
  // World orientation stays in the maps, world position does not: |root| = 1 km would swallow the
  // millimetres otherwise.
  FiveTexels example;
  const size_t size = size_t(example.body.uv_size) * example.body.uv_size * kMapChannels;
  std::vector<Affine> scratch(example.body.joint_count());
  std::vector<float> here(size), there(size);
  draw_pose_maps(example.body, example.pose, example.statistics, scratch, kMapChannels, here);
  LargestError near_error("maps after moving 10 m");
  example.pose.root_translation_m = {10.0f, -3.0f, 7.0f};
  draw_pose_maps(example.body, example.pose, example.statistics, scratch, kMapChannels, there);
  for (size_t i = 0; i < size; ++i) near_error.add(there[i], here[i]);
  EXPECT_LE(near_error.largest(),
            1e-5);  // float's step at 10 m is 9.5e-7 m; a few roundings, times the scale 2
}

TEST(PoseMaps, TurningTheRootTurnsPositionsAndNormals) {
  FiveTexels example;
  const MapStatistics raw{.mean = {}, .scale = {1, 1, 1, 1, 1, 1}};
  const size_t texels = size_t(example.body.uv_size) * example.body.uv_size;
  std::vector<Affine> scratch(example.body.joint_count());
  std::vector<float> before(texels * kMapChannels), after(texels * kMapChannels);
  draw_pose_maps(example.body, example.pose, raw, scratch, kMapChannels, before);
  // A quarter turn about y in front of the root's own rotation: q' = (s, 0, s, 0) q, unnormalised
  // with s = 1.
  const float w = example.rotations[0], x = example.rotations[1], y = example.rotations[2],
              z = example.rotations[3];
  const float turned[4] = {w - y, x + z, y + w, z - x};
  std::copy(turned, turned + 4, example.rotations.begin());
  draw_pose_maps(example.body, example.pose, raw, scratch, kMapChannels, after);
  LargestError error("maps after a quarter turn");
  for (size_t t = 0; t < texels; ++t) {
    for (int part = 0; part < 2; ++part) {
      const float* b = &before[t * kMapChannels + 3 * part];
      const float* a = &after[t * kMapChannels + 3 * part];
      error.add(a[0], b[2]);
      error.add(a[1], b[1]);
      error.add(a[2], -b[0]);
    }
  }
  EXPECT_LE(error.largest(), 2e-6);
}

TEST(FourierChannels, AreSinesAndCosinesOfTexelCentres) {
  constexpr uint32_t kSize = 8, kOctaves = 5, kStride = 4 * kOctaves + 3;
  std::vector<float> maps(kSize * kSize * kStride, -7.0f);
  draw_fourier_channels(kSize, kOctaves, 1, kStride, maps);
  LargestError error("Fourier channels");
  for (uint32_t v = 0; v < kSize; ++v) {
    for (uint32_t u = 0; u < kSize; ++u) {
      const float* texel = &maps[(v * kSize + u) * kStride];
      EXPECT_EQ(texel[0], -7.0f);
      EXPECT_EQ(texel[kStride - 1], -7.0f);
      for (uint32_t o = 0; o < kOctaves; ++o) {
        const double angle_u = M_PI * (1 << o) * (u + 0.5) / kSize,
                     angle_v = M_PI * (1 << o) * (v + 0.5) / kSize;
        error.add(texel[1 + 4 * o + 0], std::sin(angle_u));
        error.add(texel[1 + 4 * o + 1], std::cos(angle_u));
        error.add(texel[1 + 4 * o + 2], std::sin(angle_v));
        error.add(texel[1 + 4 * o + 3], std::cos(angle_v));
      }
    }
  }
  EXPECT_LE(error.largest(), 6.1e-8);  // one rounding of a value up to 1
}

// The sizes and octaves of the shipped avatars: no bit of their input is a matter of who computes
// it.
TEST(FourierChannels, OfShippedSizesAreTheTrueValuesRoundedOnce) {
  constexpr uint32_t kOctaves = 5, kStride = 4 * kOctaves;
  constexpr long double kPi = 3.141592653589793238462643383279502884L;
  for (const uint32_t size : {32u, 128u}) {
    std::vector<float> maps(size_t(size) * size * kStride);
    draw_fourier_channels(size, kOctaves, 0, kStride, maps);
    size_t different = 0;
    for (uint32_t v = 0; v < size; ++v) {
      for (uint32_t o = 0; o < kOctaves; ++o) {
        const long double angle = kPi * (1 << o) * (v + 0.5L) / size;
        const float sine = static_cast<float>(std::sin(angle)),
                    cosine = static_cast<float>(std::cos(angle));
        for (uint32_t u = 0; u < size; ++u) {
          const float* down = &maps[(size_t(v) * size + u) * kStride + 4 * o];
          const float* across = &maps[(size_t(u) * size + v) * kStride + 4 * o];
          different += (across[0] != sine) + (across[1] != cosine);
          different += (down[2] != sine) + (down[3] != cosine);
        }
      }
    }
    EXPECT_EQ(different, 0u) << "of " << maps.size() << " values at T = " << size;
  }
}

}  // namespace
}  // namespace figurine::body_test
