#include "toolchain/body/chart_packer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "figurine/check.h"
#include "toolchain/random/split_mix.h"

namespace figurine::body {
namespace {

constexpr double kStep = 1.004;       // by which the scale must grow to count as better
constexpr double kLeastScale = 1e-3;  // of the one that would fill the square
constexpr uint64_t kSeed = 29;

// Rows of bits, each padded by one word of zeros, so that a shifted row may be read past its end.
struct Bitmap {
  int width = 0, height = 0, words = 0;
  std::vector<uint64_t> bits;

  Bitmap(int w, int h) : width(w), height(h), words(w / 64 + 2) {
    bits.assign(static_cast<size_t>(words) * static_cast<size_t>(h), 0);
  }
  uint64_t* row(int y) { return bits.data() + static_cast<size_t>(y) * static_cast<size_t>(words); }
  const uint64_t* row(int y) const {
    return bits.data() + static_cast<size_t>(y) * static_cast<size_t>(words);
  }
  void set(int x, int y) { row(y)[x / 64] |= uint64_t{1} << (x % 64); }
};

struct Box {
  Point2 low{1e30, 1e30}, high{-1e30, -1e30};
};

Box bounds(const FlatChart& chart, uint32_t turns) {
  Box box;
  for (const Point2& corner : chart.corners) {
    const Point2 p = turned(corner, turns);
    for (size_t i = 0; i < 2; ++i) {
      box.low[i] = std::min(box.low[i], p[i]);
      box.high[i] = std::max(box.high[i], p[i]);
    }
  }
  return box;
}

// Whether the line through a and b has the whole cell strictly on the side away from c.
bool edge_separates(const Point2& a, const Point2& b, const Point2& c, double x, double y) {
  const double nx = a[1] - b[1], ny = b[0] - a[0];
  const double side = nx * (c[0] - a[0]) + ny * (c[1] - a[1]);
  const double sign = side < 0 ? -1 : 1;
  // The cell's corner that lies farthest towards c.
  const double px = sign * nx > 0 ? x + 1 : x, py = sign * ny > 0 ? y + 1 : y;
  return sign * (nx * (px - a[0]) + ny * (py - a[1])) < 0;
}

// Sets the cells that the triangle touches, its inside and its edges alike.
void touch(const std::array<Point2, 3>& p, Bitmap& out) {
  const auto [low_x, high_x] = std::minmax({p[0][0], p[1][0], p[2][0]});
  const auto [low_y, high_y] = std::minmax({p[0][1], p[1][1], p[2][1]});
  const int end_x = std::min(static_cast<int>(high_x) + 1, out.width);
  const int end_y = std::min(static_cast<int>(high_y) + 1, out.height);
  for (int y = static_cast<int>(low_y); y < end_y; ++y) {
    for (int x = static_cast<int>(low_x); x < end_x; ++x) {
      if (edge_separates(p[0], p[1], p[2], x, y) || edge_separates(p[1], p[2], p[0], x, y) ||
          edge_separates(p[2], p[0], p[1], x, y))
        continue;
      out.set(x, y);
    }
  }
}

// The cells that a chart touches at a scale, its bounding box's low corner on a cell's corner.
Bitmap outline(const FlatChart& chart, double scale_cells, uint32_t turns) {
  const Box box = bounds(chart, turns);
  Bitmap out(static_cast<int>((box.high[0] - box.low[0]) * scale_cells) + 1,
             static_cast<int>((box.high[1] - box.low[1]) * scale_cells) + 1);
  for (size_t t = 0; t + 2 < chart.corners.size(); t += 3) {
    std::array<Point2, 3> p;
    for (size_t c = 0; c < 3; ++c) {
      p[c] = turned(chart.corners[t + c], turns);
      for (size_t i = 0; i < 2; ++i) p[c][i] = (p[c][i] - box.low[i]) * scale_cells;
    }
    touch(p, out);
  }
  return out;
}

// Looks at rows far from each other first: where a chart does not fit, most of them tell.
bool is_free(const Bitmap& chart, const Bitmap& blocked, int x, int y) {
  constexpr int kStride = 16;
  const int word = x / 64, shift = x % 64;
  for (int first = 0; first < std::min(kStride, chart.height); ++first) {
    for (int r = first; r < chart.height; r += kStride) {
      const uint64_t* bits = chart.row(r);
      const uint64_t* taken = blocked.row(y + r) + word;
      for (int w = 0; w < chart.words - 1; ++w) {
        uint64_t here = taken[w] >> shift;
        if (shift > 0) here |= taken[w + 1] << (64 - shift);
        if (bits[w] & here) return false;
      }
    }
  }
  return true;
}

// Sets all cells within `reach` of the chart's, along both axes.
void block(const Bitmap& chart, int x, int y, int reach, Bitmap& blocked) {
  Bitmap line(blocked.width, 1);  // a row of the chart, widened
  for (int r = 0; r < chart.height; ++r) {
    std::fill(line.bits.begin(), line.bits.end(), 0);
    int done = 0;
    for (int c = 0; c < chart.width; ++c) {
      if (!(chart.row(r)[c / 64] >> (c % 64) & 1)) continue;
      const int end = std::min(x + c + reach + 1, blocked.width);
      for (int u = std::max(x + c - reach, done); u < end; ++u) line.set(u, 0);
      done = end;
    }
    for (int v = std::max(y + r - reach, 0); v <= std::min(y + r + reach, blocked.height - 1);
         ++v) {
      for (int w = 0; w < blocked.words; ++w)
        blocked.row(v)[w] |= line.bits[static_cast<size_t>(w)];
    }
  }
}

// One way to go about packing: in which order, how each chart is turned, and from which corner of
// the square and along which axis its place is looked for.
struct Plan {
  std::vector<size_t> order;
  std::vector<uint32_t> turns, scan;  // scan: bit 0 from the right, 1 from below, 2 columns first
};
constexpr uint32_t kScans = 8;

Plan largest_first(std::span<const double> areas) {
  Plan plan{std::vector<size_t>(areas.size()), std::vector<uint32_t>(areas.size(), 0),
            std::vector<uint32_t>(areas.size(), 0)};
  std::iota(plan.order.begin(), plan.order.end(), size_t{0});
  std::stable_sort(plan.order.begin(), plan.order.end(),
                   [&](size_t a, size_t b) { return areas[a] > areas[b]; });
  return plan;
}

uint32_t below(uint32_t count, random::SplitMix& random) {
  return static_cast<uint32_t>((random.bits() >> 32) * count >> 32);
}

// Mostly larger ones first.
Plan shuffled(std::span<const double> areas, random::SplitMix& random) {
  std::vector<double> key(areas.begin(), areas.end());
  for (double& value : key) value *= random.uniform(0.2, 1);
  Plan plan = largest_first(key);
  for (size_t i = 0; i < areas.size(); ++i) {
    plan.turns[i] = below(kTurns, random);
    plan.scan[i] = below(kScans, random);
  }
  return plan;
}

// One chart turned or looked for otherwise, or two in each other's turn.
Plan varied(Plan plan, random::SplitMix& random) {
  const uint32_t count = static_cast<uint32_t>(plan.order.size());
  switch (below(3, random)) {
    case 0:
      plan.turns[below(count, random)] = below(kTurns, random);
      break;
    case 1:
      plan.scan[below(count, random)] = below(kScans, random);
      break;
    default:
      std::swap(plan.order[below(count, random)], plan.order[below(count, random)]);
  }
  return plan;
}

class Packer {
 public:
  Packer(std::span<const FlatChart> charts, const PackingOptions& options)
      : charts_(charts),
        cells_(static_cast<int>(options.cells)),
        reach_(static_cast<int>(std::ceil(options.gap * cells_))),
        margin_(static_cast<int>(std::ceil(options.margin * cells_))) {}

  // All charts placed at this scale, or nothing.
  std::optional<Packing> place(const Plan& plan, double scale) {
    if (scale != outline_scale_) {
      outlines_.clear();
      outline_scale_ = scale;
    }
    Packing packing{scale, std::vector<Placement>(charts_.size())};
    Bitmap blocked(cells_, cells_);
    for (size_t chart : plan.order) {
      const uint32_t turns = plan.turns[chart];
      const Bitmap& bits = outline_of(chart, turns);
      const std::optional<std::array<int, 2>> at = find_place(bits, blocked, plan.scan[chart]);
      if (!at) return std::nullopt;
      const Box box = bounds(charts_[chart], turns);
      packing.placements[chart] = {turns,
                                   {(*at)[0] / static_cast<double>(cells_) - box.low[0] * scale,
                                    (*at)[1] / static_cast<double>(cells_) - box.low[1] * scale}};
      block(bits, (*at)[0], (*at)[1], reach_, blocked);
    }
    return packing;
  }

 private:
  const Bitmap& outline_of(size_t chart, uint32_t turns) {
    const auto key = std::pair(chart, turns);
    auto found = outlines_.find(key);
    if (found == outlines_.end())
      found = outlines_.emplace(key, outline(charts_[chart], outline_scale_ * cells_, turns)).first;
    return found->second;
  }

  // The first free place in the order of the scan.
  std::optional<std::array<int, 2>> find_place(const Bitmap& chart, const Bitmap& blocked,
                                               uint32_t scan) const {
    const int room_x = cells_ - 2 * margin_ - chart.width,
              room_y = cells_ - 2 * margin_ - chart.height;
    if (room_x < 0 || room_y < 0) return std::nullopt;
    const bool columns = scan & 4;
    const int outer = columns ? room_x : room_y, inner = columns ? room_y : room_x;
    for (int i = 0; i <= outer; ++i) {
      for (int j = 0; j <= inner; ++j) {
        const int along_x = columns ? i : j, along_y = columns ? j : i;
        const int x = margin_ + (scan & 1 ? room_x - along_x : along_x);
        const int y = margin_ + (scan & 2 ? room_y - along_y : along_y);
        if (is_free(chart, blocked, x, y)) return std::array<int, 2>{x, y};
      }
    }
    return std::nullopt;
  }

  std::span<const FlatChart> charts_;
  int cells_, reach_, margin_;
  double outline_scale_ = 0;
  std::map<std::pair<size_t, uint32_t>, Bitmap> outlines_;  // at outline_scale_
};

std::vector<double> chart_areas(std::span<const FlatChart> charts) {
  std::vector<double> areas;
  for (const FlatChart& chart : charts) {
    double area2 = 0;
    for (size_t t = 0; t + 2 < chart.corners.size(); t += 3) {
      const Point2 &a = chart.corners[t], &b = chart.corners[t + 1], &c = chart.corners[t + 2];
      area2 += std::abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    }
    areas.push_back(area2 / 2);
  }
  return areas;
}

}  // namespace

Point2 turned(const Point2& point, uint32_t turns) {
  // Roots of rationals: the same numbers on every machine, which libm's sine is not.
  static const std::array<Point2, 6> kTurn = {
      {{1, 0},
       {(std::sqrt(6.0) + std::sqrt(2.0)) / 4, (std::sqrt(6.0) - std::sqrt(2.0)) / 4},
       {std::sqrt(0.75), 0.5},
       {std::sqrt(0.5), std::sqrt(0.5)},
       {0.5, std::sqrt(0.75)},
       {(std::sqrt(6.0) - std::sqrt(2.0)) / 4, (std::sqrt(6.0) + std::sqrt(2.0)) / 4}}};
  const auto& [cosine, sine] = kTurn[turns % 6];
  const Point2 p = {cosine * point[0] - sine * point[1], sine * point[0] + cosine * point[1]};
  switch (turns / 6 % 4) {
    case 1:
      return {-p[1], p[0]};
    case 2:
      return {-p[0], -p[1]};
    case 3:
      return {p[1], -p[0]};
    default:
      return p;
  }
}

std::optional<Packing> pack_charts(std::span<const FlatChart> charts,
                                   const PackingOptions& options) {
  FIG_CHECK(!charts.empty(), "nothing to pack");
  const std::vector<double> areas = chart_areas(charts);
  for (double area : areas) FIG_CHECK(area > 0, "a chart without area cannot be packed");
  const double filled = 1 / std::sqrt(std::accumulate(areas.begin(), areas.end(), 0.0));

  Packer packer(charts, options);
  random::SplitMix random(random::mix_bits(kSeed));
  std::optional<Packing> best;
  Plan best_plan = largest_first(areas);
  for (double scale = filled; !best && scale > kLeastScale * filled; scale *= 0.97)
    best = packer.place(best_plan, scale);
  if (!best) return std::nullopt;
  for (uint32_t attempt = 0; attempt < options.attempts; ++attempt) {
    const Plan plan = attempt % 2 ? varied(best_plan, random) : shuffled(areas, random);
    while (std::optional<Packing> larger = packer.place(plan, best->scale * kStep)) {
      best = std::move(larger);
      best_plan = plan;
    }
  }
  return best;
}

}  // namespace figurine::body
