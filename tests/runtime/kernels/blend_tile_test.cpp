// Tiles whose pixels are known in closed form: empty, partial, order, cut, stop, not a number.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "runtime/src/kernels/table.h"

namespace figurine::blend_tile_test {
namespace {

using kernels::kTileSize;
using kernels::Splat;
using kernels::TilePixels;

// A flat Gaussian: opacity times 2^-0 at every pixel, up to its reach.
Splat flat(float opacity, float red, float green = 0, float blue = 0) {
  return {.mean_x = 16,
          .mean_y = 16,
          .slope = 0,
          .scale_u = 1e-20f,
          .scale_v = 1e-20f,
          .inverse_scale_u = 1e20f,
          .reach = 1,
          .half_height = 1e20f,
          .opacity = opacity,
          .red = red,
          .green = green,
          .blue = blue,
          .widest_dy_px = 0,
          .tile_x_begin = 0,
          .tile_y_begin = 0,
          .tile_x_last = 0,
          .tile_y_last = 0};
}

struct Blended {
  std::unique_ptr<TilePixels> pixels = std::make_unique<TilePixels>();
  kernels::BlendedTile result{};
};

class BlendTile : public ::testing::TestWithParam<Isa> {
 protected:
  Blended blend(const std::vector<Splat>& splats, std::vector<uint32_t> order,
                int32_t width = kTileSize, int32_t height = kTileSize, bool look_for_stop = true) {
    Blended blended;
    blended.result = (*kernels_for(GetParam()))
                         ->blend_tile({.splats = splats.data(),
                                       .order = order.data(),
                                       .count = static_cast<uint32_t>(order.size()),
                                       .x = 0,
                                       .y = 0,
                                       .width = width,
                                       .height = height,
                                       .alpha_cut = 1.0f / 255,
                                       .leave_out_stopped = look_for_stop ? 1u : 0u,
                                       .pixels = blended.pixels.get()});
    return blended;
  }
};

TEST_P(BlendTile, AnEmptyOneLetsAllLightThrough) {
  const Blended blended = blend({}, {}, 5, 3);
  EXPECT_EQ(blended.result.contributions, 0u);
  for (int32_t y = 0; y < 3; ++y) {
    for (int32_t x = 0; x < 5; ++x) {
      EXPECT_EQ(blended.pixels->transmittance[y * kTileSize + x], 1.0f);
      EXPECT_EQ(blended.pixels->red[y * kTileSize + x], 0.0f);
    }
  }
}

TEST_P(BlendTile, CountsOnlyPixelsOfTheImage) {
  const std::vector<Splat> splats{flat(0.5f, 1)};
  EXPECT_EQ(blend(splats, {0}).result.contributions, 1024u);
  EXPECT_EQ(blend(splats, {0}, 7, 5).result.contributions, 35u);
  EXPECT_EQ(blend(splats, {0}, 1, 1).result.contributions, 1u);
}

TEST_P(BlendTile, BlendsFrontToBackInTheListsOrder) {
  const std::vector<Splat> splats{flat(0.5f, 1), flat(0.25f, 0, 1)};
  const Blended first = blend(splats, {0, 1}), second = blend(splats, {1, 0});
  EXPECT_EQ(first.pixels->red[100], 0.5f);
  EXPECT_EQ(first.pixels->green[100], 0.5f * 0.25f);
  EXPECT_EQ(second.pixels->red[100], 0.75f * 0.5f);
  EXPECT_EQ(second.pixels->green[100], 0.25f);
  EXPECT_EQ(first.pixels->transmittance[100], 0.375f);
}

TEST_P(BlendTile, TakesAlphaAtTheCutAndNothingBelow) {
  const float cut = 1.0f / 255;
  EXPECT_EQ(blend({flat(cut, 1)}, {0}).result.contributions, 1024u);
  EXPECT_EQ(blend({flat(std::nextafter(cut, 0.0f), 1)}, {0}).result.contributions, 0u);
}

TEST_P(BlendTile, StopsBeforeWhatWouldTakeTheLightBelowTheStop) {
  const std::vector<Splat> splats{flat(1, 1), flat(1, 0, 1), flat(0.1f, 0, 0, 1)};
  const Blended blended = blend(splats, {0, 1, 2});
  EXPECT_EQ(blended.pixels->red[0], 0.99f);
  EXPECT_EQ(blended.pixels->green[0], 0.0f) << "0.01 x 0.01 is below the stop";
  EXPECT_EQ(blended.pixels->blue[0], 0.0f) << "a stopped pixel stays stopped";
  EXPECT_LT(blended.pixels->transmittance[0], 0.0f) << "and says so by its sign";
  EXPECT_EQ(std::fabs(blended.pixels->transmittance[0]), 1.0f - 0.99f);
}

TEST_P(BlendTile, AStoppedTileLeavesOutTheRest) {
  const std::vector<Splat> splats{flat(1, 1), flat(1, 0, 1)};
  std::vector<uint32_t> order(1000, 1);
  order[0] = 0;
  const Blended leaving = blend(splats, order), whole = blend(splats, order, 32, 32, false);
  EXPECT_LT(leaving.result.splats, 40u);
  EXPECT_EQ(whole.result.splats, 1000u);
  EXPECT_EQ(leaving.result.contributions, whole.result.contributions);
  for (int32_t i = 0; i < kernels::kTilePixels; ++i) {
    ASSERT_EQ(leaving.pixels->red[i], whole.pixels->red[i]);
    ASSERT_EQ(leaving.pixels->transmittance[i], whole.pixels->transmittance[i]);
  }
}

TEST_P(BlendTile, IsTheGaussianOfItsRow) {
  Splat splat = flat(0.8f, 1);
  splat.scale_u = splat.scale_v = 0.25f;
  splat.inverse_scale_u = 4;
  splat.reach = 7.7f;
  splat.half_height = 11.2f;
  splat.slope = 0.5f;
  const Blended blended = blend({splat}, {0});
  for (int32_t y = 0; y < kTileSize; ++y) {
    for (int32_t x = 0; x < kTileSize; ++x) {
      const double dx = x + 0.5 - 16, dy = y + 0.5 - 16, u = (dx - 0.5 * dy) * 0.25, v = dy * 0.25;
      const double alpha = 0.8f * std::exp2(-(u * u + v * v));
      if (std::abs(alpha - 1.0 / 255) < 1e-6) continue;
      ASSERT_NEAR(blended.pixels->red[y * kTileSize + x], alpha < 1.0 / 255 ? 0 : alpha, 3e-7)
          << x << "," << y;
    }
  }
}

TEST_P(BlendTile, ASplatOutsideTheTileChangesNothing) {
  Splat splat = flat(0.9f, 1);
  splat.scale_u = splat.scale_v = 1;
  splat.inverse_scale_u = 1;
  splat.reach = splat.half_height = 3;
  for (const float away : {-1e6f, -20.0f, 60.0f, 1e6f}) {
    splat.mean_x = away, splat.mean_y = 16;
    EXPECT_EQ(blend({splat}, {0}).result.contributions, 0u) << away;
    splat.mean_x = 16, splat.mean_y = away;
    EXPECT_EQ(blend({splat}, {0}).result.contributions, 0u) << away;
  }
}

TEST_P(BlendTile, AColourThatIsNoNumberStaysInItsOwnPixels) {
  // Projection lets none through; were there one, it would not spread.
  Splat bad = flat(0.5f, std::numeric_limits<float>::quiet_NaN());
  bad.mean_x = bad.mean_y = 4.5f;
  bad.scale_u = bad.scale_v = 2;
  bad.inverse_scale_u = 0.5f;
  bad.reach = 7;
  bad.half_height = 1.4f;
  const Blended blended = blend({bad}, {0});
  EXPECT_TRUE(std::isnan(blended.pixels->red[4 * kTileSize + 4]));
  EXPECT_EQ(blended.pixels->red[20 * kTileSize + 20], 0.0f);
  EXPECT_EQ(blended.pixels->transmittance[20 * kTileSize + 20], 1.0f);
}

INSTANTIATE_TEST_SUITE_P(Isas, BlendTile,
                         ::testing::ValuesIn(supported_isas().begin(), supported_isas().end()),
                         [](const auto& of) { return std::string(to_string(of.param)); });

}  // namespace
}  // namespace figurine::blend_tile_test
