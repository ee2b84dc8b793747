#include "toolchain/body/atlas_report.h"

#include <algorithm>
#include <cmath>

#include "figurine/texel_grid.h"
#include "toolchain/measure/statistics.h"

namespace figurine::body {
namespace {

// Largest by smallest singular value of the triangle's map from the layout to the surface.
double stretch(const Surface& surface, uint32_t t) {
  double uv[3][2];
  const float* p[3];
  for (size_t c = 0; c < 3; ++c) {
    const size_t index = size_t{surface.uv_triangles[3 * size_t{t} + c]} * 2;
    uv[c][0] = surface.uv[index];
    uv[c][1] = surface.uv[index + 1];
    p[c] = &surface.position_m[size_t{surface.triangles[3 * size_t{t} + c]} * 3];
  }
  const double u1 = uv[1][0] - uv[0][0], v1 = uv[1][1] - uv[0][1];
  const double u2 = uv[2][0] - uv[0][0], v2 = uv[2][1] - uv[0][1];
  double uu = 0, uv_product = 0, vv = 0;  // the metric, up to a factor
  for (int i = 0; i < 3; ++i) {
    const double e1 = double{p[1][i]} - p[0][i], e2 = double{p[2][i]} - p[0][i];
    const double along_u = e1 * v2 - e2 * v1, along_v = e2 * u1 - e1 * u2;
    uu += along_u * along_u;
    uv_product += along_u * along_v;
    vv += along_v * along_v;
  }
  const double half = 0.5 * std::sqrt((uu - vv) * (uu - vv) + 4 * uv_product * uv_product);
  const double least = 0.5 * (uu + vv) - half;
  return least > 0 ? std::sqrt((0.5 * (uu + vv) + half) / least) : NAN;
}

struct Samples {
  std::vector<double> spacing_mm, stretch;
};

void summarise(const Samples& samples, uint32_t uv_size, PartFigures& out) {
  out.texels = samples.spacing_mm.size();
  out.share_of_square = static_cast<double>(out.texels) / (1.0 * uv_size * uv_size);
  out.density = static_cast<double>(out.texels) / out.surface_m2;
  out.spacing_median_mm = measure::quantile(samples.spacing_mm, 0.5);
  out.spacing_p90_mm = measure::quantile(samples.spacing_mm, 0.9);
  out.stretch_median = measure::quantile(samples.stretch, 0.5);
  out.stretch_p95 = measure::quantile(samples.stretch, 0.95);
}

// [G * G] the chart that each cell stands for; kNoChart: not covered.
std::vector<uint32_t> charts_of_cells(const TexelGrid& grid, std::span<const uint32_t> chart) {
  std::vector<uint32_t> out(size_t{grid.size} * grid.size, kNoChart);
  for (size_t i = 0; i < grid.cell.size(); ++i) out[grid.cell[i]] = chart[grid.source[i]];
  return out;
}

uint32_t smallest_gap(std::span<const uint32_t> chart_of_cell, uint32_t size) {
  int gap = kMostGapCells;
  const int side = static_cast<int>(size);
  const auto at = [&](int u, int v) { return chart_of_cell[static_cast<size_t>(v * side + u)]; };
  for (int v = 0; v < side; ++v) {
    for (int u = 0; u < side; ++u) {
      if (at(u, v) == kNoChart) continue;
      // Distance d leaves d - 1 cells between; earlier rows have looked at this one already.
      for (int b = v; b <= std::min(v + gap, side - 1); ++b) {
        for (int a = std::max(u - gap, 0); a <= std::min(u + gap, side - 1); ++a) {
          if (at(a, b) == kNoChart || at(a, b) == at(u, v)) continue;
          gap = std::min(gap, std::max(std::abs(a - u), b - v) - 1);
        }
      }
    }
  }
  return static_cast<uint32_t>(gap);
}

// chart: [N] of each texel.
GridFigures measure_grid(const TexelBody& texels, std::span<const uint32_t> chart, uint32_t size) {
  const std::vector<uint32_t> chart_of_cell =
      charts_of_cells(make_texel_grid(texels.view(), size), chart);
  GridFigures out{.size = size, .gap_cells = smallest_gap(chart_of_cell, size)};
  const double cells_per_texel = 1.0 * size / texels.uv_size;
  const auto is_foreign = [&](int u, int v, uint32_t own) {
    const int side = static_cast<int>(size);
    if (u < 0 || v < 0 || u >= side || v >= side) return false;
    const uint32_t there = chart_of_cell[static_cast<size_t>(v * side + u)];
    return there != kNoChart && there != own;
  };
  for (size_t row = 0; row < texels.texel.size(); ++row) {
    const double u = (texels.texel[row] % texels.uv_size + 0.5) * cells_per_texel,
                 v = (texels.texel[row] / texels.uv_size + 0.5) * cells_per_texel;
    const int first_u = static_cast<int>(std::floor(u - 0.5)),
              first_v = static_cast<int>(std::floor(v - 0.5));
    // On the grid of the texels themselves the first of the four is the texel and has all weight.
    bool foreign = false;
    for (int k = 0; k < 4 && size < texels.uv_size; ++k)
      foreign = foreign || is_foreign(first_u + k % 2, first_v + k / 2, chart[row]);
    out.texels_beside_other_charts += foreign;
    out.texels_in_other_charts_cells +=
        is_foreign(static_cast<int>(u), static_cast<int>(v), chart[row]);
  }
  return out;
}

}  // namespace

AtlasFigures measure_atlas(const Surface& surface, const TexelBody& texels) {
  const std::vector<Chart> charts = find_charts(surface);
  const std::vector<uint32_t> chart_of_triangle = chart_of_triangles(surface);
  std::array<Samples, kBodyPartCount> samples;
  Samples all;
  std::vector<size_t> texels_of_chart(charts.size(), 0);
  std::vector<uint32_t> chart_of_texel;
  for (size_t row = 0; row < texels.texel.size(); ++row) {
    const uint32_t chart = chart_of_triangle[texels.triangle[row]];
    chart_of_texel.push_back(chart);
    ++texels_of_chart[chart];
    for (Samples* list : {&samples[static_cast<size_t>(charts[chart].part)], &all}) {
      list->spacing_mm.push_back(1e3 * double{texels.spacing_m[row]});
      list->stretch.push_back(stretch(surface, texels.triangle[row]));
    }
  }
  AtlasFigures out;
  for (uint32_t part = 0; part < kBodyPartCount; ++part) {
    PartFigures figures{.part = static_cast<BodyPart>(part)};
    for (const Chart& chart : charts) {
      if (chart.part != figures.part) continue;
      ++figures.charts;
      figures.surface_m2 += chart.surface_m2;
    }
    if (figures.charts == 0) continue;
    out.whole.charts += figures.charts;
    out.whole.surface_m2 += figures.surface_m2;
    summarise(samples[part], texels.uv_size, figures);
    out.parts.push_back(figures);
  }
  summarise(all, texels.uv_size, out.whole);
  const double unit =
      out.parts.front().part == BodyPart::kBody ? out.parts.front().density : out.whole.density;
  for (PartFigures& figures : out.parts) figures.density /= unit;
  out.whole.density /= unit;
  for (uint32_t i = 0; i < charts.size(); ++i) {
    if (texels_of_chart[i] == 0) out.charts_without_texels.push_back(i);
  }
  for (uint32_t step : {1u, 2u, 4u}) {
    const uint32_t size = texels.uv_size / step;
    if (size >= 8 && grid_fits(texels.uv_size, size))
      out.grids.push_back(measure_grid(texels, chart_of_texel, size));
  }
  return out;
}

}  // namespace figurine::body
