// Grids over drawn maps whose cells, sources, borders and taps are known in closed form.
#include "figurine/texel_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

namespace figurine::texel_grid_test {
namespace {

using Rows = std::vector<std::string>;
using Numbers = std::vector<uint32_t>;

// Two rings around what is covered, each cell with the nearest covered one, of equals the first:
// the rule by which bodies are made (toolchain/body/texel_body.cpp), over all pairs.
void border_by_all_pairs(uint32_t size, const Numbers& covered, Numbers& border, Numbers& source) {
  for (uint32_t at = 0; at < size * size; ++at) {
    if (std::ranges::find(covered, at) != covered.end()) continue;
    std::pair<uint32_t, uint32_t> nearest{UINT32_MAX, 0};  // squared distance, row
    for (uint32_t row = 0; row < covered.size(); ++row) {
      const int du = int(at % size) - int(covered[row] % size);
      const int dv = int(at / size) - int(covered[row] / size);
      if (std::max(std::abs(du), std::abs(dv)) > 2) continue;
      nearest = std::min(nearest, {static_cast<uint32_t>(du * du + dv * dv), row});
    }
    if (nearest.first == UINT32_MAX) continue;
    border.push_back(at);
    source.push_back(nearest.second);
  }
}

// A body of which the grids see everything that they look at: '#' is a covered texel.
struct DrawnBody {
  explicit DrawnBody(const Rows& rows) {
    const auto size = static_cast<uint32_t>(rows.size());
    for (uint32_t at = 0; at < size * size; ++at) {
      if (rows[at / size][at % size] == '#') texel.push_back(at);
    }
    border_by_all_pairs(size, texel, border_texel, border_source);
    body.uv_size = size;
    body.texel = texel;
    body.border_texel = border_texel;
    body.border_source = border_source;
  }
  DrawnBody(const DrawnBody&) = delete;

  uint32_t row(uint32_t u, uint32_t v) const {
    const auto found = std::ranges::find(texel, v * body.uv_size + u);
    EXPECT_NE(found, texel.end()) << u << ", " << v;
    return static_cast<uint32_t>(found - texel.begin());
  }

  Numbers texel, border_texel, border_source;
  Body body;
};

Rows whole(uint32_t size) { return Rows(size, std::string(size, '#')); }

// Six texels in ten, by a linear congruential generator (Numerical Recipes' constants).
Rows scattered(uint32_t size, uint32_t seed) {
  Rows rows(size, std::string(size, '.'));
  for (std::string& row : rows) {
    for (char& texel : row) {
      seed = seed * 1664525u + 1013904223u;
      if ((seed >> 16) % 10 < 6) texel = '#';
    }
  }
  return rows;
}

// The texel's taps that count: {cell, weight} by cell.
std::vector<std::pair<uint32_t, float>> taps_of(const DrawnBody& drawn, uint32_t size, uint32_t u,
                                                uint32_t v) {
  const TexelGrid grid = make_texel_grid(drawn.body, size);
  const GridTaps taps = make_grid_taps(drawn.body, grid)[drawn.row(u, v)];
  std::vector<std::pair<uint32_t, float>> list;
  for (int k = 0; k < 4; ++k) {
    if (taps.weight[k] != 0) list.emplace_back(grid.cell[taps.row[k]], taps.weight[k]);
  }
  return list;
}

using Taps = std::vector<std::pair<uint32_t, float>>;

TEST(TexelGrid, FitsAtOneHalfAQuarterOrAnEighthOfTheSide) {
  for (const uint32_t size : {8u, 4u, 2u, 1u}) EXPECT_TRUE(grid_fits(8, size)) << size;
  for (const uint32_t size : {0u, 3u, 5u, 7u, 16u, UINT32_MAX})
    EXPECT_FALSE(grid_fits(8, size)) << size;
  EXPECT_FALSE(grid_fits(16, 1));
  EXPECT_FALSE(grid_fits(0, 0));
  EXPECT_TRUE(grid_fits(100, 25));
  EXPECT_FALSE(grid_fits(100, 12));
}

TEST(TexelGrid, OfTheTexelsIsTheTexelsAndTheirBorder) {
  const DrawnBody drawn(scattered(8, 1));
  const TexelGrid grid = make_texel_grid(drawn.body, 8);
  EXPECT_EQ(grid.size, 8u);
  EXPECT_EQ(grid.cell, drawn.texel);
  Numbers rows(drawn.texel.size());
  std::iota(rows.begin(), rows.end(), 0u);
  EXPECT_EQ(grid.source, rows);
  EXPECT_EQ(grid.border_cell, drawn.border_texel);
  EXPECT_EQ(grid.border_source, drawn.border_source);
  const std::vector<GridTaps> taps = make_grid_taps(drawn.body, grid);
  ASSERT_EQ(taps.size(), drawn.texel.size());
  for (uint32_t i = 0; i < taps.size(); ++i) {
    for (const uint32_t row : taps[i].row) EXPECT_EQ(row, i);
    EXPECT_EQ(std::to_array(taps[i].weight), (std::array<float, 4>{1, 0, 0, 0}));
  }
}

TEST(TexelGrid, CoversACellWhereOneOfItsTexelsIs) {
  const DrawnBody drawn({"........",  //
                         ".#......",  //
                         "........",  //
                         "........",  //
                         "......##",  //
                         "......##",  //
                         "........",  //
                         ".......#"});
  EXPECT_EQ(make_texel_grid(drawn.body, 4).cell, (Numbers{0, 11, 15}));
  EXPECT_EQ(make_texel_grid(drawn.body, 2).cell, (Numbers{0, 3}));
  EXPECT_EQ(make_texel_grid(drawn.body, 1).cell, (Numbers{0}));
}

TEST(TexelGrid, ACellStandsForTheTexelNearestItsCentre) {
  // Of a whole cell the first of the four around the centre.
  const DrawnBody full(whole(8));
  EXPECT_EQ(make_texel_grid(full.body, 4).source[5], full.row(2, 2));
  EXPECT_EQ(make_texel_grid(full.body, 2).source,
            (Numbers{full.row(1, 1), full.row(5, 1), full.row(1, 5), full.row(5, 5)}));
  EXPECT_EQ(make_texel_grid(full.body, 1).source, (Numbers{full.row(3, 3)}));
  // Cells of 4 x 4: opposite corners are equal, so the first; an edge is nearer than a corner; of
  // two as near, the first; one alone.
  const DrawnBody drawn({"#...#...",  //
                         ".......#",  //
                         "........",  //
                         "...#....",  //
                         "...#....",  //
                         "........",  //
                         ".#....#.",  //
                         "........"});
  EXPECT_EQ(make_texel_grid(drawn.body, 2).source,
            (Numbers{drawn.row(0, 0), drawn.row(7, 1), drawn.row(1, 6), drawn.row(6, 6)}));
}

TEST(TexelGrid, BordersAreTwoRingsOfTheNearestCell) {
  // One cell of 8 x 8: the square around it, cut at the map's edge.
  Rows rows(16, std::string(16, '.'));
  rows[6][3] = '#';  // cell (1, 3)
  const TexelGrid one = make_texel_grid(DrawnBody(rows).body, 8);
  Numbers square;
  for (uint32_t v = 1; v <= 5; ++v) {
    for (uint32_t u = 0; u <= 3; ++u) {
      if (u != 1 || v != 3) square.push_back(v * 8 + u);
    }
  }
  EXPECT_EQ(one.border_cell, square);
  EXPECT_EQ(one.border_source, Numbers(square.size(), 0));
  // Two cells with one between: it repeats the first, the others the nearer.
  rows[6][7] = '#';  // cell (3, 3)
  const TexelGrid two = make_texel_grid(DrawnBody(rows).body, 8);
  const auto source_at = [&](uint32_t u, uint32_t v) {
    const auto found = std::ranges::find(two.border_cell, v * 8 + u);
    return two.border_source[static_cast<size_t>(found - two.border_cell.begin())];
  };
  EXPECT_EQ(source_at(2, 3), 0u);
  EXPECT_EQ(source_at(2, 1), 0u);
  EXPECT_EQ(source_at(4, 3), 1u);
  EXPECT_EQ(source_at(0, 3), 0u);
  EXPECT_EQ(source_at(5, 5), 1u);
  for (uint32_t seed = 0; seed < 8; ++seed) {
    for (const uint32_t size : {8u, 4u}) {
      // Every other stripe of the coarser cells is free.
      Rows sparse = scattered(32, seed);
      for (uint32_t v = 0; v < 32; ++v) {
        if (v / 8 % 2 == seed % 2) sparse[v] = std::string(32, '.');
      }
      const DrawnBody drawn(sparse);
      const TexelGrid grid = make_texel_grid(drawn.body, size);
      Numbers border, source;
      border_by_all_pairs(size, grid.cell, border, source);
      EXPECT_EQ(grid.border_cell, border) << seed;
      EXPECT_EQ(grid.border_source, source) << seed;
      EXPECT_FALSE(border.empty());
    }
  }
}

TEST(GridTaps, AreBilinearBetweenHalfPixelCentres) {
  const DrawnBody drawn(whole(8));
  EXPECT_EQ(taps_of(drawn, 4, 1, 1),
            (Taps{{0, 9 / 16.f}, {1, 3 / 16.f}, {4, 3 / 16.f}, {5, 1 / 16.f}}));
  EXPECT_EQ(taps_of(drawn, 4, 2, 1),
            (Taps{{0, 3 / 16.f}, {1, 9 / 16.f}, {4, 1 / 16.f}, {5, 3 / 16.f}}));
  EXPECT_EQ(taps_of(drawn, 4, 3, 4),
            (Taps{{5, 3 / 16.f}, {6, 1 / 16.f}, {9, 9 / 16.f}, {10, 3 / 16.f}}));
  EXPECT_EQ(taps_of(drawn, 2, 4, 4),
            (Taps{{0, 9 / 64.f}, {1, 15 / 64.f}, {2, 15 / 64.f}, {3, 25 / 64.f}}));
  const DrawnBody large(whole(16));
  EXPECT_EQ(
      taps_of(large, 2, 5, 9),
      (Taps{{0, 13 * 5 / 256.f}, {1, 3 * 5 / 256.f}, {2, 13 * 11 / 256.f}, {3, 3 * 11 / 256.f}}));
}

TEST(GridTaps, AtTheMapsEdgeRepeatTheEdge) {
  const DrawnBody drawn(whole(8));
  EXPECT_EQ(taps_of(drawn, 4, 0, 0), (Taps{{0, 1}}));
  EXPECT_EQ(taps_of(drawn, 4, 1, 0), (Taps{{0, 0.75f}, {1, 0.25f}}));
  EXPECT_EQ(taps_of(drawn, 4, 7, 3), (Taps{{7, 0.75f}, {11, 0.25f}}));
  EXPECT_EQ(taps_of(drawn, 4, 7, 7), (Taps{{15, 1}}));
  EXPECT_EQ(taps_of(drawn, 1, 2, 6), (Taps{{0, 1}}));
}

TEST(GridTaps, LeaveOutCellsWithoutTexels) {
  const DrawnBody drawn({"####....",  //
                         "####....",  //
                         "##......",  //
                         "##......",  //
                         "........",  //
                         "........",  //
                         "........",  //
                         "........"});
  // Three of four cells: 9 + 3 + 3 sixteenths.
  EXPECT_EQ(taps_of(drawn, 4, 1, 1), (Taps{{0, 9 / 16.f / (15 / 16.f)},
                                           {1, 3 / 16.f / (15 / 16.f)},
                                           {4, 3 / 16.f / (15 / 16.f)}}));
  EXPECT_EQ(taps_of(drawn, 4, 3, 1), (Taps{{1, 1}}));
  EXPECT_EQ(taps_of(drawn, 4, 1, 3), (Taps{{4, 1}}));
}

TEST(GridTaps, NeverCrossCharts) {
  // Cells of 4 x 4. Left chart: columns 0 to 4; right chart: 6 and 7. Cell 1 stands for the right
  // one, whose column 6 is nearest its centre.
  const DrawnBody drawn(Rows(8, "#####.##"));
  EXPECT_EQ(make_texel_grid(drawn.body, 2).source[1], drawn.row(6, 1));
  EXPECT_EQ(taps_of(drawn, 2, 3, 0), (Taps{{0, 1}}));
  EXPECT_EQ(taps_of(drawn, 2, 4, 0), (Taps{{0, 1}}));  // in cell 1, and not its value
  EXPECT_EQ(taps_of(drawn, 2, 6, 0), (Taps{{1, 1}}));
  EXPECT_EQ(taps_of(drawn, 2, 6, 2), (Taps{{1, 0.875f}, {3, 0.125f}}));
}

TEST(GridTaps, ATexelWithNoCellOfItsChartTakesItsOwn) {
  // Two charts side by side in cell 0, which stands for the right one.
  const DrawnBody drawn(Rows(8, "#.######"));
  EXPECT_EQ(make_texel_grid(drawn.body, 2).source[0], drawn.row(2, 1));
  EXPECT_EQ(taps_of(drawn, 2, 0, 0), (Taps{{0, 1}}));
  EXPECT_EQ(taps_of(drawn, 2, 0, 7), (Taps{{2, 1}}));
  EXPECT_EQ(taps_of(drawn, 2, 2, 0), (Taps{{0, 0.875f}, {1, 0.125f}}));
}

TEST(GridTaps, ChartsTouchAtCorners) {
  const DrawnBody touching({"##..",  //
                            "##..",  //
                            "..##",  //
                            "..##"});
  EXPECT_EQ(taps_of(touching, 2, 1, 1),
            (Taps{{0, 9 / 16.f / (10 / 16.f)}, {3, 1 / 16.f / (10 / 16.f)}}));
  const DrawnBody apart({"#...",  //
                         "....",  //
                         "..##",  //
                         "..##"});
  EXPECT_EQ(taps_of(apart, 2, 0, 0), (Taps{{0, 1}}));
  EXPECT_EQ(taps_of(apart, 2, 2, 2), (Taps{{3, 1}}));
}

TEST(GridTaps, AreWeightsOfCellsOnAnyMap) {
  for (uint32_t seed = 0; seed < 16; ++seed) {
    const DrawnBody drawn(scattered(16, seed));
    for (const uint32_t size : {16u, 8u, 4u, 2u}) {
      const TexelGrid grid = make_texel_grid(drawn.body, size);
      EXPECT_TRUE(std::ranges::is_sorted(grid.cell));
      for (const GridTaps& taps : make_grid_taps(drawn.body, grid)) {
        float sum = 0;
        for (int k = 0; k < 4; ++k) {
          ASSERT_LT(taps.row[k], grid.cell_count());
          ASSERT_GE(taps.weight[k], 0);
          sum += taps.weight[k];
        }
        ASSERT_NEAR(sum, 1, 1e-6);
      }
    }
  }
}

TEST(GridTaps, ReproduceALineAcrossAWholeMap) {
  const DrawnBody drawn(whole(32));
  for (const uint32_t size : {16u, 8u, 4u}) {
    const uint32_t step = 32 / size;
    const TexelGrid grid = make_texel_grid(drawn.body, size);
    const std::vector<GridTaps> taps = make_grid_taps(drawn.body, grid);
    const auto line = [](double u, double v) { return 0.75 * u - 0.25 * v + 3; };
    for (uint32_t i = 0; i < taps.size(); ++i) {
      const double u = drawn.texel[i] % 32 + 0.5, v = drawn.texel[i] / 32 + 0.5;
      if (std::min(u, v) < step / 2.0 || std::max(u, v) > 32 - step / 2.0) continue;  // the edge
      double value = 0;
      for (int k = 0; k < 4; ++k) {
        const uint32_t cell = grid.cell[taps[i].row[k]];
        value += double(taps[i].weight[k]) *
                 line((cell % size + 0.5) * step, (cell / size + 0.5) * step);
      }
      ASSERT_NEAR(value, line(u, v), 1e-5) << "step " << step << ", texel " << i;
    }
  }
}

}  // namespace
}  // namespace figurine::texel_grid_test
