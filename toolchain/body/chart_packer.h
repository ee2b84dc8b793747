// Packs flat charts into the unit square: all at one common scale, turned by quarters, never nearer
// to each other than a given gap, and as large as a search finds.
//
// Outlines, not boxes, are packed: a hand fits under an arm. Charts become bitmaps of the cells
// that they touch, so a placement that looks free is free; the search tries many orders and turns
// and keeps the largest scale. Integers and a pinned generator decide: the same layout on every
// machine. What it does not do: cut, mirror or bend charts. Based on: the chart packing of Levy,
// Petitjean, Ray, Maillot, Least Squares Conformal Maps for Automatic Texture Atlas Generation,
// 2002, section 4 (discretised outlines), with random restarts in place of horizons.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace figurine::body {

using Point2 = std::array<double, 2>;

struct FlatChart {
  std::vector<Point2> corners;  // three to a triangle, in units of the common scale
};

struct PackingOptions {
  double gap = 1.0 / 32;     // largest-norm distance between any two charts, of the square's side
  double margin = 1.0 / 64;  // between charts and the square's edge
  uint32_t cells =
      256;  // a side of the square: outlines are made of them, charts lie at whole ones
  uint32_t attempts = 4000;  // orders and turns that are tried
};

inline constexpr uint32_t kTurns = 24;  // of 15 degrees, from x to y

// A chart's point, turned about the origin, times scale, plus offset, lies in the unit square.
struct Placement {
  uint32_t turns = 0;
  Point2 offset{};
};

struct Packing {
  double scale = 0;
  std::vector<Placement> placements;  // one a chart
};

Point2 turned(const Point2& point, uint32_t turns);

// Nothing if no scale above a thousandth of that which would fill the square fits. Every chart must
// have an area above 0.
std::optional<Packing> pack_charts(std::span<const FlatChart> charts,
                                   const PackingOptions& options = {});

}  // namespace figurine::body
