// The frame path's transforms, maps and decoding, in blocks, against the definitions that the
// trainer shares (figurine/pose.h, figurine/body.h, figurine/avatar.h): equal to the bit.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/gaussian.h"
#include "runtime/src/base/float_math.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/body_grid.h"
#include "runtime/src/pose/maps.h"
#include "runtime/src/pose/transforms.h"
#include "runtime/test_packages.h"

namespace figurine::posed_texels_test {
namespace {

using tests::SyntheticBody;
using tests::SyntheticPose;

ThreadPool make_pool(uint32_t threads) { return std::move(ThreadPool::create(threads)).value(); }

class PosedTexels : public ::testing::TestWithParam<Isa> {
 protected:
  PosedTexels() {
    joints_ = std::vector<float>(body_.body().joint_position_m.begin(),
                                 body_.body().joint_position_m.end());
    for (size_t i = 0; i < joints_.size(); ++i) joints_[i] += 0.01f * static_cast<float>(i % 7);
    EXPECT_TRUE(blocks_.ensure(body_.body()));
    EXPECT_TRUE(transforms_.ensure(body_.body().joint_count(), blocks_.count()));
  }

  const KernelTable& kernels() const { return **kernels_for(GetParam()); }

  // 247 covered texels or so: the last block is not full.
  SyntheticBody body_ = tests::make_test_body({.uv_size = 19, .joints = 6});
  std::vector<float> joints_;
  BodyBlocks blocks_;
  Transforms transforms_;
};

TEST_P(PosedTexels, LanesBehindTheLastTexelRepeatIt) {
  const Body& body = body_.body();
  const uint32_t last = blocks_.count() - 1, texels = body.texel_count();
  EXPECT_EQ(blocks_.count(), (texels + 15) / 16);
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    const uint32_t texel = std::min(last * kernels::kLanes + lane, texels - 1);
    EXPECT_EQ(texel_of_lane(last, lane, texels), texel);
    EXPECT_EQ(blocks_[last].mean_position_m[1][lane], body.texel_position_m[3 * texel + 1]);
    EXPECT_EQ(blocks_[last].joint[0][lane], body.texel_joints[kSkinInfluences * texel]);
  }
}

TEST_P(PosedTexels, TransformsAreThoseOfTheDefinition) {
  const Body& body = body_.body();
  for (const uint32_t threads : {1u, 2u}) {
    ThreadPool pool = make_pool(threads);
    const SyntheticPose pose = tests::make_test_pose(body, 3);
    transforms_.pose(body, blocks_, joints_, pose.view(), pool, kernels());
    std::vector<Affine> mean(body.joint_count()), own(body.joint_count());
    skinning_transforms(body.mean_skeleton(), pose.view(), mean);
    skinning_transforms({body.parents, joints_}, pose.view(), own);
    for (uint32_t i = 0; i < body.texel_count(); ++i) {
      const uint8_t* joints = &body.texel_joints[size_t(i) * kSkinInfluences];
      const float* weights = &body.texel_weights[size_t(i) * kSkinInfluences];
      const Affine of_mean = blend(mean, joints, weights), of_own = blend(own, joints, weights);
      const kernels::TransformBlock& block = transforms_[i / kernels::kLanes];
      const uint32_t lane = i % kernels::kLanes;
      for (int row = 0; row < 3; ++row) {
        for (int k = 0; k < 3; ++k) {
          ASSERT_EQ(block.linear[3 * row + k][lane], of_mean.m[4 * row + k]);
          ASSERT_EQ(block.linear[3 * row + k][lane], of_own.m[4 * row + k]);
        }
        ASSERT_EQ(block.mean_translation_m[row][lane], of_mean.m[4 * row + 3]);
        ASSERT_EQ(block.own_translation_m[row][lane], of_own.m[4 * row + 3]);
      }
    }
  }
}

TEST_P(PosedTexels, MapsAreThoseOfTheDefinition) {
  const Body& body = body_.body();
  const MapStatistics statistics{.mean = {0.1f, 0.2f, -0.1f, 0, 0.05f, 0},
                                 .scale = {2, 2.5f, 3, 1, 1, 0.5f}};
  const std::shared_ptr<const BodyGrid> grid = BodyGrid::create(body, body.uv_size);
  ASSERT_TRUE(grid != nullptr && grid->of_texels());
  const uint32_t stride = kMapChannels + 2;
  const size_t values = size_t(body.uv_size) * body.uv_size * stride;
  for (const uint32_t threads : {1u, 3u}) {
    ThreadPool pool = make_pool(threads);
    std::vector<float> truth(values, 0.0f), maps(values, 0.0f);
    std::vector<Affine> scratch(body.joint_count());
    for (const uint32_t frame : {0u, 1u, 5u}) {
      const SyntheticPose pose = tests::make_test_pose(body, frame);
      draw_pose_maps(body, pose.view(), statistics, scratch, stride, truth);
      transforms_.pose(body, blocks_, joints_, pose.view(), pool, kernels());
      draw_maps(*grid, blocks_, transforms_, root_position(body.mean_skeleton(), pose.view()),
                statistics, {maps.data(), stride}, pool, kernels());
      ASSERT_EQ(std::memcmp(truth.data(), maps.data(), values * sizeof(float)), 0)
          << "frame " << frame << ", " << threads << " threads";
    }
  }
}

// One texel's Gaussian as avatar.h writes it down.
struct Gaussian {
  std::array<float, 3> position;
  std::array<float, 9> factor;
  float opacity;
};

struct Extents {
  float spacing_m;  // of scale 1
  float smallest_m;
};

Gaussian decode(const HeadDecoding& d, const float* h, const float* texel, const Extents& extents,
                const Affine& transform) {
  const auto clamp = [](float x, float limit) {
    return x < -limit ? -limit : (x > limit ? limit : x);
  };
  float canonical[3], scale[3];
  for (int k = 0; k < 3; ++k) {
    canonical[k] =
        texel[k] + d.offset_scale_m * (d.max_offset == 0 ? h[k] : clamp(h[k], d.max_offset));
    scale[k] = extents.spacing_m * exp_float(clamp(h[3 + k], d.max_log_scale));
  }
  const float quaternion[4] = {1.0f + h[6], h[7], h[8], h[9]};
  const std::array<float, 9> rotation = rotation_from_quaternion(quaternion);
  Gaussian gaussian{.position = transform_point(transform, canonical),
                    .factor = {},
                    .opacity = logistic(h[10] + d.opacity_bias)};
  for (float& own : scale) {
    if (extents.smallest_m == 0) break;
    const float wide = std::sqrt(own * own + extents.smallest_m * extents.smallest_m);
    gaussian.opacity *= own / wide;
    own = wide;
  }
  const std::array<float, 12>& m = transform.m;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      gaussian.factor[3 * i + j] = m[4 * i] * (rotation[j] * scale[j]) +
                                   m[4 * i + 1] * (rotation[3 + j] * scale[j]) +
                                   m[4 * i + 2] * (rotation[6 + j] * scale[j]);
    }
  }
  return gaussian;
}

TEST_P(PosedTexels, DecodingIsThatOfTheDefinition) {
  tests::Random random(8);
  for (int round = 0; round < 60; ++round) {
    const HeadDecoding decoding{.sh_degree = static_cast<uint32_t>(round % 4),
                                .max_offset = round % 2 == 0 ? 0.0f : 0.75f};
    const uint32_t sh_values = 3 * sh_coefficients(decoding.sh_degree);
    kernels::CanonicalBlock texels{};
    kernels::TransformBlock transforms{};
    kernels::ExtentBlock smallest{};
    std::vector<float> heads(kernels::kLanes * (11 + sh_values));
    for (float& value : heads) value = random.normal() * (round % 3 == 0 ? 20.0f : 1.0f);
    heads[6] = -1, heads[7] = heads[8] = heads[9] = 0;  // no rotation at all
    heads[11 + sh_values + 6] = INFINITY;
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      for (auto& plane : texels.position_m) plane[lane] = random.uniform(-1, 1);
      for (auto& plane : transforms.linear) plane[lane] = random.uniform(-1, 1);
      for (auto& plane : transforms.own_translation_m) plane[lane] = random.uniform(-1, 1);
      texels.extent_m[lane] = random.uniform(0.001f, 0.02f);
      smallest.smallest_m[lane] = lane % 4 == 0 || round % 5 == 0 ? 0 : random.uniform(1e-9f, 0.1f);
    }
    kernels::GaussianBlock block;
    kernels::DecodeSkinJob job{
        .head = {},
        .taps = nullptr,
        .static_part = nullptr,
        .smallest = round % 5 == 0 ? nullptr : &smallest,
        .texels = &texels,
        .transforms = &transforms,
        .offset_scale_m = decoding.offset_scale_m,
        .max_offset = decoding.max_offset == 0 ? INFINITY : decoding.max_offset,
        .max_log_scale = decoding.max_log_scale,
        .opacity_bias = decoding.opacity_bias,
        .sh_values = sh_values,
        .gaussians = &block};
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
      job.head[0][lane] = &heads[lane * (11 + sh_values)];
    kernels().decode_skin(job);
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const float texel[3] = {texels.position_m[0][lane], texels.position_m[1][lane],
                              texels.position_m[2][lane]};
      Affine transform;
      for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) transform.m[4 * i + k] = transforms.linear[3 * i + k][lane];
        transform.m[4 * i + 3] = transforms.own_translation_m[i][lane];
      }
      const Gaussian truth = decode(decoding, job.head[0][lane], texel,
                                    {texels.extent_m[lane], smallest.smallest_m[lane]}, transform);
      for (int k = 0; k < 3; ++k) ASSERT_EQ(block.position_m[k][lane], truth.position[k]);
      for (int k = 0; k < 9; ++k) ASSERT_EQ(block.factor[k][lane], truth.factor[k]);
      ASSERT_EQ(block.opacity[lane], truth.opacity);
      for (uint32_t k = 0; k < sh_values; ++k)
        ASSERT_EQ(block.sh[k][lane], job.head[0][lane][11 + k]);
    }
  }
}

TEST_P(PosedTexels, ASmallestExtentBlursAndKeepsTheWeight) {
  // Scales of 3, 4 and 12 mm with s = 4 mm: 5, 5.66 and 12.65 mm, volume times opacity as before.
  constexpr double kScale[3] = {0.003, 0.004, 0.012}, kSmallest = 0.004;
  kernels::CanonicalBlock texels{};
  kernels::TransformBlock transforms{};
  kernels::ExtentBlock smallest{};
  float head[14] = {};
  for (int k = 0; k < 3; ++k) head[3 + k] = static_cast<float>(std::log(kScale[k] / 0.01));
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    texels.extent_m[lane] = 0.01f;
    smallest.smallest_m[lane] = lane == 0 ? 0 : static_cast<float>(kSmallest);
    for (int k = 0; k < 9; k += 4) transforms.linear[k][lane] = 1;
  }
  kernels::GaussianBlock block;
  kernels::DecodeSkinJob job{.head = {},
                             .taps = nullptr,
                             .static_part = nullptr,
                             .smallest = &smallest,
                             .texels = &texels,
                             .transforms = &transforms,
                             .offset_scale_m = 1,
                             .max_offset = INFINITY,
                             .max_log_scale = 4,
                             .opacity_bias = 0,
                             .sh_values = 3,
                             .gaussians = &block};
  std::fill_n(job.head[0], kernels::kLanes, head);
  kernels().decode_skin(job);
  double volume = 1, weight = 0.5;
  for (int k = 0; k < 3; ++k) {
    const double wide = std::sqrt(kScale[k] * kScale[k] + kSmallest * kSmallest);
    EXPECT_NEAR(block.factor[4 * k][0], kScale[k], 1e-8) << "without one, as it was";
    EXPECT_NEAR(block.factor[4 * k][1], wide, 1e-8);
    weight *= kScale[k];
    volume *= block.factor[4 * k][1];
  }
  EXPECT_EQ(block.opacity[0], 0.5f);
  EXPECT_NEAR(block.opacity[1] * volume, weight, 1e-6 * weight);
}

INSTANTIATE_TEST_SUITE_P(Isas, PosedTexels,
                         ::testing::ValuesIn(supported_isas().begin(), supported_isas().end()),
                         [](const auto& of) { return std::string(to_string(of.param)); });

}  // namespace
}  // namespace figurine::posed_texels_test
