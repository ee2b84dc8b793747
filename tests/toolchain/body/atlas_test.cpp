// Layouts by weight: closed forms on squares of known size, all promises on the mannequin.
#include "toolchain/body/atlas.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "figurine/texel_grid.h"
#include "toolchain/body/atlas_picture.h"
#include "toolchain/body/atlas_report.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/test_files.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body::atlas_test {
namespace {

constexpr AtlasOptions kQuick{.uv_size = 128, .coarsest_grid = 32, .attempts = 200};

AtlasOptions weighted(std::initializer_list<std::pair<BodyPart, double>> weights,
                      AtlasOptions options = kQuick) {
  for (const auto& [part, weight] : weights) options.weight[static_cast<size_t>(part)] = weight;
  return options;
}

// Adds a square of a side in metres, skinned to one joint, with a chart of its own of another size.
void add_square(Surface& surface, float side_m, uint8_t joint, float u, float v, float side_uv) {
  const uint32_t vertex = surface.vertex_count(), uv = static_cast<uint32_t>(surface.uv.size() / 2);
  for (const auto& [x, y] : {std::pair{0.0f, 0.0f}, {1.0f, 0.0f}, {1.0f, 1.0f}, {0.0f, 1.0f}}) {
    surface.position_m.insert(surface.position_m.end(), {x * side_m, y * side_m, 0.0f});
    surface.uv.insert(surface.uv.end(), {u + x * side_uv, v + (1 - y) * side_uv});
    for (uint32_t k = 0; k < kSkinInfluences; ++k) {
      surface.skin_joints.push_back(k == 0 ? joint : 0);
      surface.skin_weights.push_back(k == 0 ? 1.0f : 0.0f);
    }
  }
  for (uint32_t c : {0u, 1u, 2u, 0u, 2u, 3u}) {
    surface.triangles.push_back(vertex + c);
    surface.uv_triangles.push_back(uv + c);
  }
  surface.hidden.insert(surface.hidden.end(), {0, 0});
}

// Trunk of 0.36 m2 and head of 0.04, crowded in the layout; a left and a right hand of 0.01 each.
BodyModel squares() {
  BodyModel model;
  model.name = "squares";
  add_square(model.surface, 0.6f, kSpine2, 0.0f, 0.0f, 0.5f);
  add_square(model.surface, 0.2f, kHead, 0.5f, 0.0f, 0.5f);
  add_square(model.surface, 0.1f, kLeftIndex1, 0.5f, 0.5f, 0.25f);
  add_square(model.surface, 0.1f, kRightWrist, 0.75f, 0.5f, 0.125f);
  return model;
}

TexelBody texels_of(const Surface& surface, uint32_t size) {
  BodyModel model;
  model.surface = surface;
  return make_texel_body(model, size);
}

std::map<BodyPart, double> texels_by_part(const Surface& surface, uint32_t size) {
  std::map<BodyPart, double> count;
  for (const PartFigures& part : measure_atlas(surface, texels_of(surface, size)).parts)
    count[part.part] = static_cast<double>(part.texels);
  return count;
}

TEST(Atlas, ChartsArePiecesThatHangTogetherAndTheirPartIsMostOfThem) {
  BodyModel model = squares();
  const std::vector<Chart> charts = find_charts(model.surface);
  ASSERT_EQ(charts.size(), 4u);
  const BodyPart parts[] = {BodyPart::kBody, BodyPart::kHead, BodyPart::kHands, BodyPart::kHands};
  const double areas[] = {0.36, 0.04, 0.01, 0.01}, uv_areas[] = {0.25, 0.25, 0.0625, 0.015625};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(charts[i].part, parts[i]);
    EXPECT_NEAR(charts[i].surface_m2, areas[i], 1e-7);
    EXPECT_NEAR(charts[i].uv_area, uv_areas[i], 1e-7);
    EXPECT_EQ(charts[i].triangles, (std::vector<uint32_t>{static_cast<uint32_t>(2 * i),
                                                          static_cast<uint32_t>(2 * i + 1)}));
  }
  model.surface.hidden[2] = model.surface.hidden[3] = 1;
  EXPECT_EQ(find_charts(model.surface).size(), 3u);
  // Half trunk, half head is neither's: whole.
  model = squares();
  for (size_t vertex : {0u, 3u}) model.surface.skin_joints[vertex * kSkinInfluences] = kHead;
  EXPECT_EQ(find_charts(model.surface)[0].part, BodyPart::kBody);
  for (size_t vertex : {1u}) model.surface.skin_joints[vertex * kSkinInfluences] = kHead;
  EXPECT_EQ(find_charts(model.surface)[0].part, BodyPart::kHead);
}

TEST(Atlas, WeightsAreTexelsForEachSquareMetre) {
  const BodyModel model = squares();
  const std::map<BodyPart, double> even = texels_by_part(pack_atlas(model.surface, kQuick), 512),
                                   four = texels_by_part(
                                       pack_atlas(model.surface,
                                                  weighted({{BodyPart::kHands, 4.0},
                                                            {BodyPart::kHead, 2.0}})),
                                       512);
  const auto density = [](const std::map<BodyPart, double>& count, BodyPart part, double area) {
    return count.at(part) / area / (count.at(BodyPart::kBody) / 0.36);
  };
  std::printf("densities: even %.3f %.3f, weighted %.3f %.3f\n",
              density(even, BodyPart::kHead, 0.04), density(even, BodyPart::kHands, 0.02),
              density(four, BodyPart::kHead, 0.04), density(four, BodyPart::kHands, 0.02));
  EXPECT_NEAR(density(even, BodyPart::kHead, 0.04), 1, 0.03);
  EXPECT_NEAR(density(even, BodyPart::kHands, 0.02), 1, 0.03);
  EXPECT_NEAR(density(four, BodyPart::kHead, 0.04), 2, 0.06);
  EXPECT_NEAR(density(four, BodyPart::kHands, 0.02), 4, 0.12);
}

TEST(Atlas, KeepsChartsTwoCellsOfTheCoarsestGridApart) {
  const BodyModel model = make_mannequin();
  const AtlasOptions options = weighted({{BodyPart::kHands, 3.0}, {BodyPart::kHead, 2.0}});
  const Surface surface = pack_atlas(model.surface, options);
  const std::vector<Chart> charts = find_charts(surface);
  ASSERT_EQ(charts.size(), find_charts(model.surface).size());
  std::vector<uint32_t> chart_of(surface.triangle_count());
  for (uint32_t i = 0; i < charts.size(); ++i) {
    for (uint32_t t : charts[i].triangles) chart_of[t] = i;
  }
  const TexelBody texels = texels_of(surface, options.uv_size);
  const figurine::Body view = texels.view();
  for (uint32_t size : {options.coarsest_grid, options.uv_size / 2, options.uv_size}) {
    const TexelGrid grid = make_texel_grid(view, size);
    const int side = static_cast<int>(size);
    std::vector<int> chart(size_t{size} * size, -1);
    for (size_t i = 0; i < grid.cell.size(); ++i)
      chart[grid.cell[i]] = static_cast<int>(chart_of[texels.triangle[grid.source[i]]]);
    const auto at = [&](int u, int v) { return chart[static_cast<size_t>(v * side + u)]; };
    for (int v = 0; v < side; ++v) {
      for (int u = 0; u < side; ++u) {
        if (at(u, v) < 0) continue;
        for (int b = v; b <= std::min(v + 2, side - 1); ++b) {
          for (int a = std::max(u - 2, 0); a <= std::min(u + 2, side - 1); ++a)
            ASSERT_TRUE(at(a, b) < 0 || at(a, b) == at(u, v)) << size << ": " << u << "," << v;
        }
      }
    }
    // The first border ring is the chart's own.
    for (size_t i = 0; i < grid.border_cell.size(); ++i) {
      const int u = static_cast<int>(grid.border_cell[i] % size),
                v = static_cast<int>(grid.border_cell[i] / size);
      for (int k = 0; k < 9; ++k) {
        const int a = u + k % 3 - 1, b = v + k / 3 - 1;
        if (a < 0 || b < 0 || a >= side || b >= side || at(a, b) < 0) continue;
        ASSERT_EQ(static_cast<uint32_t>(at(a, b)),
                  chart_of[texels.triangle[grid.source[grid.border_source[i]]]]);
      }
    }
  }
  for (uint32_t texel : texels.texel) {
    const uint32_t last = options.uv_size - 1, u = texel % options.uv_size,
                   v = texel / options.uv_size;
    EXPECT_TRUE(u > 0 && v > 0 && u < last && v < last) << "on the square's edge";
  }
  const AtlasFigures figures = measure_atlas(surface, texels);
  ASSERT_EQ(figures.grids.size(), 3u);
  const uint32_t least[] = {8, 4, 2};
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_GE(figures.grids[i].gap_cells, least[i]);
    EXPECT_EQ(figures.grids[i].texels_beside_other_charts, 0u);
    EXPECT_EQ(figures.grids[i].texels_in_other_charts_cells, 0u);
  }
}

TEST(Atlas, NoTriangleOfTheLayoutLiesOverAnother) {
  const Surface surface = pack_atlas(make_mannequin().surface, kQuick);
  double area = 0;
  for (const Chart& chart : find_charts(surface)) area += chart.uv_area;
  const double covered = static_cast<double>(texels_of(surface, 512).texel.size()) / (512 * 512);
  std::printf("covered %.4f, area %.4f\n", covered, area);
  EXPECT_NEAR(covered, area, 3e-3);
  EXPECT_GT(covered, 0.3);
}

TEST(Atlas, SameSurfaceGivesTheSameLayout) {
  const Surface source = squares().surface;
  const AtlasOptions options = weighted({{BodyPart::kHands, 4.0}});
  const Surface first = pack_atlas(source, options), second = pack_atlas(source, options);
  EXPECT_EQ(first.uv, second.uv);
  EXPECT_EQ(first.uv_triangles, source.uv_triangles);
  EXPECT_EQ(first.position_m, source.position_m);
  // Turned and moved, never mirrored.
  const auto signed_area = [](const Surface& surface, size_t t) {
    const float *a = &surface.uv[2 * size_t{surface.uv_triangles[3 * t]}],
                *b = &surface.uv[2 * size_t{surface.uv_triangles[3 * t + 1]}],
                *c = &surface.uv[2 * size_t{surface.uv_triangles[3 * t + 2]}];
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  };
  for (size_t t = 0; t < source.triangle_count(); ++t)
    EXPECT_GT(signed_area(first, t) * signed_area(source, t), 0);
}

TEST(Atlas, RefusesWhatItCannotLayOut) {
  const Surface surface = squares().surface;
  const auto error = [&](const AtlasOptions& options) {
    return test::input_error([&] { pack_atlas(surface, options); });
  };
  for (double weight : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(error(weighted({{BodyPart::kHead, weight}})),
              "atlas: weight of head: is not a positive number");
  }
  EXPECT_EQ(error(weighted({{BodyPart::kLegs, 2.0}})),
            "atlas: weight of legs: no chart is mostly legs; there are: body, head, hands");
  EXPECT_EQ(error({.coarsest_grid = 4}),
            "atlas: 4 charts do not fit with two cells of a grid of 4 between them");
  for (uint32_t grid : {3u, 129u}) {
    EXPECT_EQ(
        error({.uv_size = 128, .coarsest_grid = grid}),
        "atlas: coarsest grid: " + std::to_string(grid) + " cells a side: is not within 4 and 128");
  }
  Surface flat = surface;
  for (size_t i = 8; i < 16; i += 2) flat.uv[i] = 0.5f;  // the head's chart becomes a line
  EXPECT_EQ(test::input_error([&] { pack_atlas(flat, kQuick); }),
            "atlas: chart 1 (head): has no area");
  flat.hidden.assign(flat.hidden.size(), 1);
  EXPECT_EQ(test::input_error([&] { pack_atlas(flat, kQuick); }),
            "atlas: the surface has no chart");
  EXPECT_EQ(find_body_part("hands"), BodyPart::kHands);
  EXPECT_FALSE(find_body_part("hand"));
}

TEST(AtlasFigures, OfSquaresAreExact) {
  Surface surface;
  add_square(surface, 0.8f, kSpine2, 0.0f, 0.0f, 0.5f);  // 1.6 m to the square's side: 25 mm at 64
  add_square(surface, 0.4f, kHead, 0.625f, 0.0f, 0.25f);
  for (size_t i = 13; i < 24; i += 3) surface.position_m[i] *= 2;  // twice as high as wide
  const AtlasFigures figures = measure_atlas(surface, texels_of(surface, 64));
  ASSERT_EQ(figures.parts.size(), 2u);
  const PartFigures &body = figures.parts[0], &head = figures.parts[1];
  EXPECT_EQ(body.texels, 32u * 32);
  EXPECT_EQ(head.texels, 16u * 16);
  EXPECT_NEAR(body.share_of_square, 0.25, 1e-12);
  EXPECT_NEAR(body.spacing_median_mm, 25, 1e-4);
  EXPECT_NEAR(body.stretch_p95, 1, 1e-6);
  EXPECT_NEAR(head.spacing_p90_mm, 37.5, 1e-4);  // 25 along u, 50 along v
  EXPECT_NEAR(head.stretch_median, 2, 1e-6);
  EXPECT_NEAR(head.density, 0.5, 1e-6);
  EXPECT_EQ(figures.whole.charts, 2u);
  EXPECT_NEAR(figures.whole.surface_m2, 0.96, 1e-6);
  EXPECT_TRUE(figures.charts_without_texels.empty());
  // An eighth of the side between the charts: 8, 4 and 2 cells.
  ASSERT_EQ(figures.grids.size(), 3u);
  const uint32_t gaps[] = {8, 4, 2};
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(figures.grids[i].size, 64u >> i);
    EXPECT_EQ(figures.grids[i].gap_cells, gaps[i]);
    EXPECT_EQ(figures.grids[i].texels_beside_other_charts, 0u);
    EXPECT_EQ(figures.grids[i].texels_in_other_charts_cells, 0u);
  }
}

TEST(AtlasFigures, CountTexelsThatReadAnotherChart) {
  // Charts side by side: the body's last column, u = 31, and the head's first, 16 texels high.
  Surface surface;
  add_square(surface, 0.8f, kSpine2, 0.0f, 0.0f, 0.5f);
  add_square(surface, 0.4f, kHead, 0.5f, 0.0f, 0.25f);
  AtlasFigures figures = measure_atlas(surface, texels_of(surface, 64));
  EXPECT_EQ(figures.grids[0].gap_cells, 0u);
  EXPECT_EQ(figures.grids[0].texels_beside_other_charts, 0u);
  // At 32 a texel of the body in row v reads the cells of rows floor(v/2 - 1/4) and the next, of
  // which one is among the head's 8 up to v = 16.
  EXPECT_EQ(figures.grids[1].texels_beside_other_charts, 17u + 16);
  EXPECT_EQ(figures.grids[1].texels_in_other_charts_cells, 0u);
  // Half a cell further, the cells at the seam hold one column of each and stand for the body's,
  // whose texels come first.
  for (size_t i = 0; i < 8; i += 2) surface.uv[i] += 1 / 64.0f;
  for (size_t i = 8; i < 16; i += 2) surface.uv[i] += 1 / 64.0f;
  figures = measure_atlas(surface, texels_of(surface, 64));
  EXPECT_EQ(figures.grids[1].texels_in_other_charts_cells, 16u);
}

TEST(AtlasPicture, ShowsPartsBordersAndNothing) {
  const Surface surface = squares().surface;
  const ports::ImageU8 picture = draw_atlas(surface, texels_of(surface, 64));
  ASSERT_EQ(picture.width_px, 512u);
  const auto colour = [&](uint32_t texel_u, uint32_t texel_v) {
    const uint8_t* p = picture.at(texel_u * 8 + 4, texel_v * 8 + 4);
    return std::array<int, 3>{p[0], p[1], p[2]};
  };
  EXPECT_EQ(colour(10, 10), (std::array<int, 3>{74, 118, 196}));  // body
  EXPECT_EQ(colour(40, 10), (std::array<int, 3>{204, 72, 80}));   // head
  EXPECT_EQ(colour(10, 60), (std::array<int, 3>{255, 255, 255}));
  EXPECT_GT(colour(10, 33)[0], 150);  // border of the body
  EXPECT_LT(colour(10, 33)[0], 255);
}

}  // namespace
}  // namespace figurine::body::atlas_test
