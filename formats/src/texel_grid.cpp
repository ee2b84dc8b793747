#include "figurine/texel_grid.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"

namespace figurine {
namespace {

constexpr uint32_t kNone = ~uint32_t{0};
constexpr int32_t kRings = 2;  // of border cells, as bodies have them

// [T * T] row of every covered texel, kNone elsewhere.
std::vector<uint32_t> rows_of_texels(const Body& body) {
  std::vector<uint32_t> row(size_t{body.uv_size} * body.uv_size, kNone);
  for (uint32_t i = 0; i < body.texel_count(); ++i) row[body.texel[i]] = i;
  return row;
}

// Calls visit(cell index, squared distance) for the cells within `reach` of (u, v), rows first.
template <class Visit>
void for_neighbours(uint32_t size, uint32_t u, uint32_t v, int32_t reach, Visit visit) {
  const auto side = static_cast<int32_t>(size);
  for (int32_t dv = -reach; dv <= reach; ++dv) {
    for (int32_t du = -reach; du <= reach; ++du) {
      const int32_t x = static_cast<int32_t>(u) + du, y = static_cast<int32_t>(v) + dv;
      if (x < 0 || y < 0 || x >= side || y >= side) continue;
      visit(static_cast<uint32_t>(y) * size + static_cast<uint32_t>(x), du * du + dv * dv);
    }
  }
}

// [N] number of the chart that each covered texel is in.
std::vector<uint32_t> charts_of(const Body& body) {
  const std::vector<uint32_t> row = rows_of_texels(body);
  std::vector<uint32_t> chart(body.texel_count(), kNone), open;
  uint32_t charts = 0;
  for (uint32_t first = 0; first < body.texel_count(); ++first) {
    if (chart[first] != kNone) continue;
    chart[first] = charts;
    open.assign(1, first);
    while (!open.empty()) {
      const uint32_t texel = body.texel[open.back()];
      open.pop_back();
      for_neighbours(body.uv_size, texel % body.uv_size, texel / body.uv_size, 1,
                     [&](uint32_t near, int32_t) {
                       if (row[near] == kNone || chart[row[near]] != kNone) return;
                       chart[row[near]] = charts;
                       open.push_back(row[near]);
                     });
    }
    ++charts;
  }
  return chart;
}

// [G * G] row of every covered cell, kNone elsewhere.
std::vector<uint32_t> rows_of_cells(const TexelGrid& grid) {
  std::vector<uint32_t> row(size_t{grid.size} * grid.size, kNone);
  for (uint32_t i = 0; i < grid.cell_count(); ++i) row[grid.cell[i]] = i;
  return row;
}

void cover(const Body& body, TexelGrid& grid) {
  const uint32_t step = body.uv_size / grid.size;
  std::vector<uint32_t> source(size_t{grid.size} * grid.size, kNone), distance(source.size());
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const uint32_t u = body.texel[i] % body.uv_size, v = body.texel[i] / body.uv_size;
    const size_t cell = size_t{v / step} * grid.size + u / step;
    // From the cell's centre, in half texels: exact.
    const auto from_centre = [&](uint32_t at) {
      const auto d = static_cast<int32_t>(2 * (at % step) + 1) - static_cast<int32_t>(step);
      return static_cast<uint32_t>(d * d);
    };
    const uint32_t d = from_centre(u) + from_centre(v);
    if (source[cell] != kNone && d >= distance[cell]) continue;
    source[cell] = i, distance[cell] = d;
  }
  for (uint32_t cell = 0; cell < source.size(); ++cell) {
    if (source[cell] == kNone) continue;
    grid.cell.push_back(cell);
    grid.source.push_back(source[cell]);
  }
}

void add_border(const Body& body, TexelGrid& grid) {
  if (grid.size == body.uv_size) {
    grid.border_cell.assign(body.border_texel.begin(), body.border_texel.end());
    grid.border_source.assign(body.border_source.begin(), body.border_source.end());
    return;
  }
  const std::vector<uint32_t> row = rows_of_cells(grid);
  for (uint32_t cell = 0; cell < row.size(); ++cell) {
    if (row[cell] != kNone) continue;
    uint32_t nearest = kNone;
    int32_t nearest_distance = 0;
    for_neighbours(grid.size, cell % grid.size, cell / grid.size, kRings,
                   [&](uint32_t near, int32_t distance) {
                     if (row[near] == kNone) return;
                     const bool nearer = nearest == kNone || distance < nearest_distance ||
                                         (distance == nearest_distance && row[near] < nearest);
                     if (!nearer) return;
                     nearest = row[near], nearest_distance = distance;
                   });
    if (nearest == kNone) continue;
    grid.border_cell.push_back(cell);
    grid.border_source.push_back(nearest);
  }
}

// Along one axis: the first of the two cells around a texel's centre (-1 before the grid), and the
// weight of the second. Quarters, eighths and sixteenths: exact.
struct Between {
  int32_t first;
  float second_weight;
};
Between between(uint32_t texel, uint32_t step) {
  const int32_t twice = static_cast<int32_t>(2 * texel + 1) - static_cast<int32_t>(step);
  const auto cell = static_cast<int32_t>(2 * step);
  const int32_t first = twice >= 0 ? twice / cell : -((-twice + cell - 1) / cell);
  return {first, static_cast<float>(twice - first * cell) / static_cast<float>(cell)};
}

}  // namespace

bool grid_fits(uint32_t uv_size, uint32_t size) {
  for (uint32_t step = 1; step <= kMaxGridStep; step *= 2) {
    if (size > 0 && size * uint64_t{step} == uv_size) return true;
  }
  return false;
}

TexelGrid make_texel_grid(const Body& body, uint32_t size) {
  FIG_CHECK(grid_fits(body.uv_size, size), "a grid of 1, 1/2, 1/4 or 1/8 of the texels a side");
  TexelGrid grid{.size = size, .cell = {}, .source = {}, .border_cell = {}, .border_source = {}};
  cover(body, grid);
  add_border(body, grid);
  return grid;
}

std::vector<GridTaps> make_grid_taps(const Body& body, const TexelGrid& grid) {
  std::vector<GridTaps> taps(body.texel_count());
  const uint32_t step = body.uv_size / grid.size;
  if (step == 1) {
    for (uint32_t i = 0; i < taps.size(); ++i) taps[i] = {{i, i, i, i}, {1, 0, 0, 0}};
    return taps;
  }
  const std::vector<uint32_t> row = rows_of_cells(grid), chart = charts_of(body);
  const auto side = static_cast<int32_t>(grid.size);
  for (uint32_t i = 0; i < taps.size(); ++i) {
    const uint32_t u = body.texel[i] % body.uv_size, v = body.texel[i] / body.uv_size;
    const uint32_t own = row[size_t{v / step} * grid.size + u / step];
    const Between x = between(u, step), y = between(v, step);
    float sum = 0;
    for (int k = 0; k < 4; ++k) {
      const int32_t cu = x.first + k % 2, cv = y.first + k / 2;
      const float weight = (k % 2 == 1 ? x.second_weight : 1 - x.second_weight) *
                           (k / 2 == 1 ? y.second_weight : 1 - y.second_weight);
      const bool inside = cu >= 0 && cv >= 0 && cu < side && cv < side;
      const uint32_t tap = inside ? row[static_cast<size_t>(cv * side + cu)] : kNone;
      const bool counts = tap != kNone && chart[grid.source[tap]] == chart[i];
      taps[i].row[k] = counts ? tap : own;
      taps[i].weight[k] = counts ? weight : 0;
      sum += taps[i].weight[k];
    }
    if (sum > 0) {
      for (float& weight : taps[i].weight) weight /= sum;
    } else {
      taps[i].weight[0] = 1;
    }
  }
  return taps;
}

}  // namespace figurine
