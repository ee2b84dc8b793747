// The shared arithmetic of poses against the five texels of docs/numerics.md
// (tests/golden/posing/five_texels.json, made in float64 by scripts/make_five_texels.py from the
// equations alone). The renderer's half of the example is held by
// tests/stability/five_texels_test.cpp.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "figurine/body.h"
#include "figurine/pose.h"
#include "tests/golden/posing/five_texels.h"
#include "tests/largest_error.h"

namespace figurine::posing_golden_test {
namespace {

using golden::FiveTexels;

// Twenty roundings of float32 (6e-8) of values up to 2: a dot product of a blended row, after three
// products of rotations.
constexpr double kTolerance = 1.5e-6;

void expect_transforms(std::span<const Affine> actual, const golden::Json& expected) {
  LargestError error("skinning transform");
  for (size_t j = 0; j < actual.size(); ++j) {
    for (int i = 0; i < 12; ++i) error.add(actual[j].m[i], expected[j][i / 4][i % 4]);
  }
  EXPECT_LE(error.largest(), kTolerance);
}

TEST(FiveTexelsPosing, SkinningTransformsOfTheMeanTemplate) {
  const FiveTexels example;
  std::vector<Affine> transforms(example.body.joint_count());
  skinning_transforms(example.body.mean_skeleton(), example.pose, transforms);
  expect_transforms(transforms, example.expected["mean_world_from_rest"]);
}

TEST(FiveTexelsPosing, OwnShapeMovesJointsTexelsAndTransforms) {
  const FiveTexels example;
  std::vector<float> joints(example.body.joint_position_m.size()),
      texels(example.body.texel_position_m.size());
  shape_body(example.body, example.shape, joints, texels);
  LargestError error("own shape");
  for (size_t i = 0; i < joints.size(); ++i)
    error.add(joints[i], example.expected["own_joint_position_m"][i / 3][i % 3]);
  for (size_t i = 0; i < texels.size(); ++i)
    error.add(texels[i], example.expected["texels"][i / 3]["own_position_m"][i % 3]);
  EXPECT_LE(error.largest(), kTolerance);

  std::vector<Affine> transforms(example.body.joint_count());
  skinning_transforms({example.body.parents, joints}, example.pose, transforms);
  expect_transforms(transforms, example.expected["own_world_from_rest"]);
}

TEST(FiveTexelsPosing, BlendedTransformsOfEveryTexel) {
  const FiveTexels example;
  std::vector<Affine> transforms(example.body.joint_count());
  skinning_transforms(example.body.mean_skeleton(), example.pose, transforms);
  LargestError error("blended transform");
  for (size_t i = 0; i < example.body.texel_count(); ++i) {
    const Affine blended = blend(transforms, &example.body.texel_joints[i * kSkinInfluences],
                                 &example.body.texel_weights[i * kSkinInfluences]);
    for (int k = 0; k < 12; ++k)
      error.add(blended.m[k], example.expected["texels"][i]["mean_blend"][k / 4][k % 4]);
  }
  EXPECT_LE(error.largest(), kTolerance);
}

TEST(FiveTexelsPosing, MapsHoldStandardisedPositionNormalAndFourierChannels) {
  const FiveTexels example;
  constexpr uint32_t kStride =
      12;  // two channels more than the example uses: they must stay as they are
  const uint32_t size = example.body.uv_size;
  std::vector<float> maps(size_t(size) * size * kStride, -7.0f);
  std::vector<Affine> scratch(example.body.joint_count());
  draw_pose_maps(example.body, example.pose, example.statistics, scratch, kStride, maps);
  draw_fourier_channels(size, example.fourier_octaves, kMapChannels, kStride, maps);

  LargestError error("network input");
  std::vector<bool> filled(size_t(size) * size, false);
  for (size_t i = 0; i < example.body.texel_count(); ++i) {
    const float* texel = &maps[size_t(example.body.texel[i]) * kStride];
    filled[example.body.texel[i]] = true;
    const golden::Json& expected = example.expected["texels"][i]["network_input"];
    ASSERT_EQ(expected.size(), 10u);
    for (size_t c = 0; c < expected.size(); ++c) error.add(texel[c], expected[c]);
  }
  EXPECT_LE(error.largest(), kTolerance);
  for (size_t i = 0; i < example.body.border_texel.size(); ++i) {
    filled[example.body.border_texel[i]] = true;
    for (uint32_t c = 0; c < kMapChannels; ++c) {
      EXPECT_EQ(maps[example.body.border_texel[i] * kStride + c],
                maps[example.body.texel[example.body.border_source[i]] * kStride + c]);
    }
  }
  for (size_t t = 0; t < filled.size(); ++t) {
    for (uint32_t c = 0; c < kMapChannels && !filled[t]; ++c)
      EXPECT_EQ(maps[t * kStride + c], 0.0f) << "texel " << t;
    EXPECT_EQ(maps[t * kStride + 10], -7.0f);
    EXPECT_EQ(maps[t * kStride + 11], -7.0f);
  }
}

}  // namespace
}  // namespace figurine::posing_golden_test
