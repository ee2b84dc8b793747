// Projection of single Gaussians, by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "figurine/gaussian.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/splat/view.h"

namespace figurine::project_block_test {
namespace {

using kernels::GaussianBlock;
using kernels::ProjectedLanes;
using kernels::Splat;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

kernels::View front_view(float alpha_cut = kAlphaCut) {
  return make_view(
      {.width_px = 64, .height_px = 48, .fx_px = 100, .fy_px = 80, .cx_px = 32, .cy_px = 24},
      alpha_cut);
}

// A ball in every lane.
GaussianBlock balls(float x, float y, float z, float deviation_m, float opacity) {
  GaussianBlock block{};
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    block.position_m[0][lane] = x, block.position_m[1][lane] = y, block.position_m[2][lane] = z;
    for (int k = 0; k < 9; k += 4) block.factor[k][lane] = deviation_m;
    block.opacity[lane] = opacity;
  }
  return block;
}

struct Projected {
  ProjectedLanes lanes{};
  Splat splats[kernels::kLanes]{};
  float depth_m[kernels::kLanes]{};
};

class ProjectBlock : public ::testing::TestWithParam<Isa> {
 protected:
  Projected project(const GaussianBlock& block, uint32_t count = kernels::kLanes,
                    uint32_t leave_out = kernels::kLeaveOutTransparent | kernels::kLeaveOutOutside,
                    bool antialiased = false) {
    const kernels::View view = front_view();
    Projected projected;
    projected.lanes = (*kernels_for(GetParam()))
                          ->project_block({.view = &view,
                                           .gaussians = &block,
                                           .count = count,
                                           .sh_degree = 0,
                                           .leave_out = leave_out,
                                           .antialiased = antialiased ? 1u : 0u,
                                           .splats = projected.splats,
                                           .depth_m = projected.depth_m});
    return projected;
  }
};

TEST_P(ProjectBlock, ABallOnTheAxisIsACircle) {
  const Projected projected = project(balls(0, 0, 2, 0.1f, 0.5f));
  EXPECT_EQ(projected.lanes.visible, 0xffffu);
  const Splat& splat = projected.splats[3];
  EXPECT_EQ(projected.depth_m[3], 2.0f);
  EXPECT_FLOAT_EQ(splat.mean_x, 32);
  EXPECT_FLOAT_EQ(splat.mean_y, 24);
  EXPECT_EQ(splat.slope, 0.0f);
  // Variances (f s / z)^2 + 0.3; the scales hold sqrt(log2(e) / 2) / deviation.
  EXPECT_NEAR(splat.scale_u, std::sqrt(0.5 / std::log(2.0) / (25 + 0.3)), 1e-6);
  EXPECT_NEAR(splat.scale_v, std::sqrt(0.5 / std::log(2.0) / (16 + 0.3)), 1e-6);
  EXPECT_NEAR(splat.reach, std::log2(0.5 * 255) + 1e-3, 1e-5);
  EXPECT_EQ(splat.red, 0.5f) << "no SH: the offset alone";
}

TEST_P(ProjectBlock, OnlyLanesThatHoldAGaussianCount) {
  for (uint32_t count = 1; count <= kernels::kLanes; ++count) {
    EXPECT_EQ(project(balls(0, 0, 2, 0.1f, 0.5f), count).lanes.visible, (1u << count) - 1);
  }
}

TEST_P(ProjectBlock, WhatIsNotFiniteIsLeftOutLaneByLane) {
  GaussianBlock block = balls(0, 0, 2, 0.1f, 0.5f);
  block.position_m[0][0] = kNan;
  block.position_m[2][1] = kInf;
  block.factor[4][2] = kNan;
  block.factor[0][3] = 3e38f;
  block.opacity[4] = kNan;
  block.opacity[5] = kInf;
  block.sh[1][6] = kInf;
  block.opacity[7] = -1;
  const ProjectedLanes lanes = project(block).lanes;
  EXPECT_EQ(lanes.visible, 0xff00u);
  EXPECT_EQ(lanes.transparent, 0u);
  EXPECT_EQ(lanes.outside, 0u);
}

TEST_P(ProjectBlock, WhatIsTransparentOrOutsideIsNamed) {
  GaussianBlock block = balls(0, 0, 2, 0.1f, 0.5f);
  block.opacity[0] = std::nextafter(kAlphaCut, 0.0f);
  block.position_m[0][1] = 5;      // 282 pixels, 18 wide: beyond the right edge
  block.position_m[1][2] = -5;     // beyond the top
  block.position_m[2][3] = 0.2f;   // at the near plane
  block.position_m[0][4] = 0.75f;  // 69.5 pixels: outside by its centre, inside by its width
  const ProjectedLanes lanes = project(block).lanes;
  EXPECT_EQ(lanes.transparent, 0x1u);
  EXPECT_EQ(lanes.outside, 0x6u);
  EXPECT_EQ(lanes.visible, 0xfff0u);
}

TEST_P(ProjectBlock, NothingLeftOutChangesAPixel) {
  // With the switches off they come along, but reach nothing: no pixel centre, or only by slack.
  GaussianBlock block = balls(0, 0, 2, 0.1f, 0.5f);
  block.opacity[0] = std::nextafter(kAlphaCut, 0.0f);
  block.position_m[0][1] = 5;
  const Projected all = project(block, kernels::kLanes, 0);
  EXPECT_EQ(all.lanes.visible, 0xffffu);
  EXPECT_LT(all.splats[0].reach, 2e-3f);
  EXPECT_EQ(all.splats[1].tile_x_begin, 1u);
  EXPECT_EQ(all.splats[1].tile_x_last, 1u);
}

TEST_P(ProjectBlock, AntialiasedTheDilationAddsNoWeight) {
  constexpr uint32_t kLeaveOut = kernels::kLeaveOutTransparent | kernels::kLeaveOutOutside;
  GaussianBlock block = balls(0, 0, 2, 0.01f, 0.8f);
  for (int k = 0; k < 9; ++k) block.factor[k][1] = 0;  // a point
  block.factor[0][2] = 0.1f, block.factor[4][2] = 0;   // a disc seen edge-on
  block.factor[8][2] = 0.1f;
  block.factor[0][3] = block.factor[4][3] = block.factor[8][3] = 1e-25f;  // squares underflow
  block.opacity[4] = 0.005f;  // above the cut until its dilation is made up for
  const Projected without = project(block), with = project(block, kernels::kLanes, kLeaveOut, true);
  EXPECT_EQ(without.lanes.visible, 0xffffu);
  EXPECT_EQ(with.lanes.visible, 0xffe1u);
  EXPECT_EQ(with.lanes.transparent, 0x1eu);
  // Variances (f s / z)^2 = 0.25 and 0.16 before 0.1 is added.
  const double left = std::sqrt(0.25 * 0.16 / ((0.25 + 0.1) * (0.16 + 0.1)));
  EXPECT_EQ(without.splats[0].opacity, 0.8f);
  EXPECT_NEAR(with.splats[0].opacity, 0.8 * left, 1e-6);
  EXPECT_NEAR(with.splats[0].reach, std::log2(0.8 * left * 255) + 1e-3, 1e-4);
  EXPECT_LT(with.splats[0].half_height, without.splats[0].half_height);
  EXPECT_NEAR(without.splats[0].scale_u, std::sqrt(0.5 * M_LOG2E / (0.25 + 0.3)), 1e-5);
  EXPECT_NEAR(with.splats[0].scale_u, std::sqrt(0.5 * M_LOG2E / (0.25 + 0.1)), 1e-5);
  // Where nothing is left out they come along and reach nothing.
  const Projected all = project(block, kernels::kLanes, 0, true);
  EXPECT_EQ(all.lanes.visible, 0xffffu);
  for (const int lane : {1, 2, 3, 4}) EXPECT_LT(all.splats[lane].reach, 2e-3f) << lane;
}

TEST_P(ProjectBlock, TheBoxHoldsEveryPixelThatReachesTheCut) {
  for (const float slant : {-0.8f, 0.0f, 0.6f}) {
    GaussianBlock block = balls(0.1f, -0.05f, 2, 0.2f, 0.9f);
    block.factor[3][0] = slant * 0.2f;
    const Projected projected = project(block, 1);
    ASSERT_EQ(projected.lanes.visible, 1u);
    const Splat& s = projected.splats[0];
    for (uint32_t y = 0; y < 48; ++y) {
      for (uint32_t x = 0; x < 64; ++x) {
        const double dx = x + 0.5 - s.mean_x, dy = y + 0.5 - s.mean_y;
        const double u = (dx - s.slope * dy) * s.scale_u, v = dy * s.scale_v;
        if (s.opacity * std::exp2(-(u * u + v * v)) < kAlphaCut) continue;
        ASSERT_GE(x / 32, s.tile_x_begin);
        ASSERT_LE(x / 32, s.tile_x_last);
        ASSERT_GE(y / 32, s.tile_y_begin);
        ASSERT_LE(y / 32, s.tile_y_last);
        ASSERT_LT(u * u + v * v, s.reach);
        ASSERT_LT(std::abs(dy), s.half_height);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Isas, ProjectBlock,
                         ::testing::ValuesIn(supported_isas().begin(), supported_isas().end()),
                         [](const auto& of) { return std::string(to_string(of.param)); });

}  // namespace
}  // namespace figurine::project_block_test
