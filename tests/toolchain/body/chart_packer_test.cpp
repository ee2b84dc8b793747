// Packing against closed forms: squares in a square, a square in the corner of an L.
#include "toolchain/body/chart_packer.h"

#include <algorithm>
#include <cmath>

#include "gtest/gtest.h"

namespace figurine::body::chart_packer_test {
namespace {

void add_rectangle(FlatChart& chart, double x, double y, double width, double height) {
  const Point2 a = {x, y}, b = {x + width, y}, c = {x + width, y + height}, d = {x, y + height};
  chart.corners.insert(chart.corners.end(), {a, b, c, a, c, d});
}

FlatChart rectangle(double width, double height) {
  FlatChart chart;
  add_rectangle(chart, 5, -3, width, height);  // where it comes from does not matter
  return chart;
}

std::vector<Point2> placed_corners(const FlatChart& chart, const Packing& packing, size_t i) {
  std::vector<Point2> out;
  for (const Point2& corner : chart.corners) {
    Point2 p = turned(corner, packing.placements[i].turns);
    for (size_t k = 0; k < 2; ++k) p[k] = p[k] * packing.scale + packing.placements[i].offset[k];
    out.push_back(p);
  }
  return out;
}

// Whether a line through an edge of one triangle keeps both apart once the other is grown by a
// square of half the side `reach`: the triangles' distance in the largest norm is above it.
bool apart(const Point2* a, const Point2* b, double reach) {
  std::vector<Point2> normals = {{1, 0}, {0, 1}};
  for (const Point2* t : {a, b}) {
    for (int c = 0; c < 3; ++c)
      normals.push_back({t[c][1] - t[(c + 1) % 3][1], t[(c + 1) % 3][0] - t[c][0]});
  }
  for (const Point2& n : normals) {
    double low[2] = {1e30, 1e30}, high[2] = {-1e30, -1e30};
    for (int c = 0; c < 3; ++c) {
      for (int which = 0; which < 2; ++which) {
        const Point2& p = (which == 0 ? a : b)[c];
        const double along = n[0] * p[0] + n[1] * p[1];
        low[which] = std::min(low[which], along);
        high[which] = std::max(high[which], along);
      }
    }
    const double grown = reach * (std::abs(n[0]) + std::abs(n[1]));
    if (high[0] + grown <= low[1] || high[1] + grown <= low[0]) return true;
  }
  return false;
}

void expect_sound(const std::vector<FlatChart>& charts, const Packing& packing,
                  const PackingOptions& options) {
  constexpr double kRounding = 1e-9;
  std::vector<std::vector<Point2>> corners;
  for (size_t i = 0; i < charts.size(); ++i) {
    corners.push_back(placed_corners(charts[i], packing, i));
    for (const Point2& p : corners[i]) {
      for (double x : p) {
        EXPECT_GE(x, options.margin - kRounding);
        EXPECT_LE(x, 1 - options.margin + kRounding);
      }
    }
  }
  for (size_t i = 0; i < charts.size(); ++i) {
    for (size_t j = i + 1; j < charts.size(); ++j) {
      for (size_t s = 0; s < corners[i].size(); s += 3) {
        for (size_t t = 0; t < corners[j].size(); t += 3)
          EXPECT_TRUE(apart(&corners[i][s], &corners[j][t], options.gap - kRounding))
              << "charts " << i << " and " << j;
      }
    }
  }
}

constexpr PackingOptions kQuick{.gap = 1.0 / 32, .margin = 1.0 / 64, .cells = 128, .attempts = 300};

TEST(ChartPacker, FourSquaresFillTheSquareButForGapAndMargin) {
  const std::vector<FlatChart> charts(4, rectangle(1, 1));
  const std::optional<Packing> packing = pack_charts(charts, kQuick);
  ASSERT_TRUE(packing);
  expect_sound(charts, *packing, kQuick);
  const double best = (1 - 2 * kQuick.margin - kQuick.gap) / 2;
  std::printf("side %.4f of at most %.4f\n", packing->scale, best);
  EXPECT_LE(packing->scale, best + 1e-9);
  // Two cells of rounding, and steps of the scale by 0.4 per cent.
  EXPECT_GE(packing->scale, best - 2.0 / kQuick.cells);
}

TEST(ChartPacker, TurnsWhatDoesNotFitUpright) {
  // Two charts of 2 x 1 beside one of 1 x 2: only turned do they make a square of 2 x 3, or better.
  const std::vector<FlatChart> charts = {rectangle(1, 3), rectangle(2, 1), rectangle(1, 2),
                                         rectangle(1, 2)};
  const std::optional<Packing> packing = pack_charts(charts, kQuick);
  ASSERT_TRUE(packing);
  expect_sound(charts, *packing, kQuick);
  const double best = (1 - 2 * kQuick.margin - 2 * kQuick.gap) / 3;  // 9 squares of a 3 x 3
  EXPECT_LE(packing->scale, best + 1e-9);
  EXPECT_GE(packing->scale, 0.9 * best);
}

TEST(ChartPacker, PacksOutlinesNotBoxes) {
  // An L of four by four with arms one wide, and a square of two: as boxes they need a side of six
  // or, with the L turned, still more than five; in the L's corner they need four.
  FlatChart corner;
  add_rectangle(corner, 0, 0, 4, 1);
  add_rectangle(corner, 0, 1, 1, 3);
  const std::vector<FlatChart> charts = {corner, rectangle(2, 2)};
  const std::optional<Packing> packing = pack_charts(charts, kQuick);
  ASSERT_TRUE(packing);
  expect_sound(charts, *packing, kQuick);
  const double room = 1 - 2 * kQuick.margin;
  EXPECT_GT(packing->scale, room / 5);
  EXPECT_LE(packing->scale, room / 4 + 1e-9);
}

TEST(ChartPacker, TurnsByFifteenDegrees) {
  constexpr double kRounding = 4e-15;  // of angles up to 2 pi, at this distance from the origin
  for (uint32_t turns = 0; turns < kTurns; ++turns) {
    const double angle = turns * 3.14159265358979323846 / 12;
    const Point2 p = turned({2, 1}, turns);
    EXPECT_NEAR(p[0], 2 * std::cos(angle) - std::sin(angle), kRounding) << turns;
    EXPECT_NEAR(p[1], 2 * std::sin(angle) + std::cos(angle), kRounding) << turns;
  }
}

TEST(ChartPacker, SameChartsGiveTheSamePlaces) {
  const std::vector<FlatChart> charts = {rectangle(3, 1), rectangle(2, 2), rectangle(1, 1),
                                         rectangle(1, 0.25)};
  const std::optional<Packing> first = pack_charts(charts, kQuick),
                               second = pack_charts(charts, kQuick);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->scale, second->scale);
  for (size_t i = 0; i < charts.size(); ++i) {
    EXPECT_EQ(first->placements[i].turns, second->placements[i].turns);
    EXPECT_EQ(first->placements[i].offset, second->placements[i].offset);
  }
}

TEST(ChartPacker, FindsNothingWhereGapsFillTheSquare) {
  const std::vector<FlatChart> charts(9, rectangle(1, 1));
  EXPECT_FALSE(pack_charts(charts, {.gap = 0.5, .margin = 0, .cells = 64, .attempts = 10}));
  EXPECT_FALSE(pack_charts(charts, {.gap = 0, .margin = 0.5, .cells = 64, .attempts = 10}));
}

}  // namespace
}  // namespace figurine::body::chart_packer_test
