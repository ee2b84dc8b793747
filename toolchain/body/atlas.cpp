#include "toolchain/body/atlas.h"

#include <algorithm>
#include <cmath>

#include "toolchain/body/chart_packer.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

constexpr uint32_t kMostCells = 512;  // of the packing, a side
constexpr std::array<const char*, kBodyPartCount> kPartNames = {"body",  "head", "arms",
                                                                "hands", "legs", "feet"};

BodyPart part_of_joint(uint32_t joint) {
  if (joint >= kLeftIndex1) return BodyPart::kHands;
  switch (joint) {
    case kNeck:
    case kHead:
    case kJaw:
    case kLeftEye:
    case kRightEye:
      return BodyPart::kHead;
    case kLeftShoulder:
    case kRightShoulder:
    case kLeftElbow:
    case kRightElbow:
      return BodyPart::kArms;
    case kLeftWrist:
    case kRightWrist:
      return BodyPart::kHands;
    case kLeftHip:
    case kRightHip:
    case kLeftKnee:
    case kRightKnee:
      return BodyPart::kLegs;
    case kLeftAnkle:
    case kRightAnkle:
    case kLeftFoot:
    case kRightFoot:
      return BodyPart::kFeet;
    default:
      return BodyPart::kBody;
  }
}

bool is_hidden(const Surface& surface, uint32_t triangle) {
  return !surface.hidden.empty() && surface.hidden[triangle];
}

double surface_area(const Surface& surface, uint32_t triangle) {
  const uint32_t* v = &surface.triangles[3 * size_t{triangle}];
  const float* p[3] = {&surface.position_m[3 * size_t{v[0]}], &surface.position_m[3 * size_t{v[1]}],
                       &surface.position_m[3 * size_t{v[2]}]};
  double e[3], f[3];
  for (int i = 0; i < 3; ++i) {
    e[i] = double{p[1][i]} - p[0][i];
    f[i] = double{p[2][i]} - p[0][i];
  }
  const double n[3] = {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2],
                       e[0] * f[1] - e[1] * f[0]};
  return 0.5 * std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

Point2 uv_corner(const Surface& surface, uint32_t triangle, size_t corner) {
  const size_t index = size_t{surface.uv_triangles[3 * size_t{triangle} + corner]} * 2;
  return {surface.uv[index], surface.uv[index + 1]};
}

double uv_area(const Surface& surface, uint32_t triangle) {
  const Point2 a = uv_corner(surface, triangle, 0), b = uv_corner(surface, triangle, 1),
               c = uv_corner(surface, triangle, 2);
  return 0.5 * std::abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}

// How much of a triangle's skin weight each part has.
std::array<double, kBodyPartCount> part_shares(const Surface& surface, uint32_t triangle) {
  std::array<double, kBodyPartCount> share{};
  for (size_t c = 0; c < 3; ++c) {
    const size_t first = size_t{surface.triangles[3 * size_t{triangle} + c]} * kSkinInfluences;
    for (size_t k = first; k < first + kSkinInfluences; ++k)
      share[static_cast<size_t>(part_of_joint(surface.skin_joints[k]))] +=
          double{surface.skin_weights[k]} / 3;
  }
  return share;
}

// The part that most of a chart belongs to: its triangles' areas, shared out by skin weights.
BodyPart most_of(const Surface& surface, const Chart& chart) {
  std::array<double, kBodyPartCount> area{};
  for (uint32_t t : chart.triangles) {
    const std::array<double, kBodyPartCount> share = part_shares(surface, t);
    for (uint32_t part = 0; part < kBodyPartCount; ++part)
      area[part] += surface_area(surface, t) * share[part];
  }
  for (uint32_t part = 0; part < kBodyPartCount; ++part) {
    if (area[part] > 0.5 * chart.surface_m2) return static_cast<BodyPart>(part);
  }
  return BodyPart::kBody;
}

bool has_part(std::span<const Chart> charts, BodyPart part) {
  return std::any_of(charts.begin(), charts.end(),
                     [&](const Chart& chart) { return chart.part == part; });
}

// "body, head, hands": what the charts are of.
std::string parts_there(std::span<const Chart> charts) {
  std::string names;
  for (uint32_t part = 0; part < kBodyPartCount; ++part) {
    if (has_part(charts, static_cast<BodyPart>(part)))
      names += (names.empty() ? "" : ", ") + std::string(kPartNames[part]);
  }
  return names;
}

void check_options(std::span<const Chart> charts, const AtlasOptions& options) {
  if (charts.empty()) throw InputError("atlas: the surface has no chart");
  if (options.coarsest_grid < 4 || options.coarsest_grid > options.uv_size) {
    throw InputError("atlas: coarsest grid: " + std::to_string(options.coarsest_grid) +
                     " cells a side: is not within 4 and " + std::to_string(options.uv_size));
  }
  for (uint32_t part = 0; part < kBodyPartCount; ++part) {
    const double weight = options.weight[part];
    const std::string name = kPartNames[part];
    if (!(weight > 0) || !std::isfinite(weight))
      throw InputError("atlas: weight of " + name + ": is not a positive number");
    if (weight != 1 && !has_part(charts, static_cast<BodyPart>(part))) {
      throw InputError("atlas: weight of " + name + ": no chart is mostly " + name +
                       "; there are: " + parts_there(charts));
    }
  }
  for (size_t i = 0; i < charts.size(); ++i) {
    if (!(charts[i].uv_area > 0) || !(charts[i].surface_m2 > 0)) {
      throw InputError("atlas: chart " + std::to_string(i) + " (" + to_string(charts[i].part) +
                       "): has no area");
    }
  }
}

// By which a chart's lengths grow in the source layout before the scale that all have in common.
double chart_size(const Chart& chart, const AtlasOptions& options) {
  const double weight = options.weight[static_cast<size_t>(chart.part)];
  return std::sqrt(weight * chart.surface_m2 / chart.uv_area);
}

// Texture coordinates belong to one chart each: they are moved where they are.
Surface placed(Surface surface, std::span<const Chart> charts, std::span<const double> sizes,
               const Packing& packing) {
  const Surface source = surface;
  for (size_t i = 0; i < charts.size(); ++i) {
    const Placement& place = packing.placements[i];
    for (uint32_t t : charts[i].triangles) {
      for (size_t c = 0; c < 3; ++c) {
        const Point2 from = uv_corner(source, t, c);
        const Point2 p = turned({from[0] * sizes[i], from[1] * sizes[i]}, place.turns);
        const size_t to = size_t{surface.uv_triangles[3 * size_t{t} + c]} * 2;
        for (size_t axis = 0; axis < 2; ++axis)
          surface.uv[to + axis] = static_cast<float>(packing.scale * p[axis] + place.offset[axis]);
      }
    }
  }
  return surface;
}

}  // namespace

const char* to_string(BodyPart part) { return kPartNames[static_cast<size_t>(part)]; }

std::optional<BodyPart> find_body_part(const std::string& name) {
  for (uint32_t part = 0; part < kBodyPartCount; ++part) {
    if (name == kPartNames[part]) return static_cast<BodyPart>(part);
  }
  return std::nullopt;
}

std::vector<uint32_t> chart_of_triangles(const Surface& surface) {
  std::vector<uint32_t> parent(surface.uv.size() / 2);
  for (uint32_t i = 0; i < parent.size(); ++i) parent[i] = i;
  const auto find = [&](uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (uint32_t t = 0; t < surface.triangle_count(); ++t) {
    if (is_hidden(surface, t)) continue;
    for (size_t c = 1; c < 3; ++c) {
      const uint32_t a = find(surface.uv_triangles[3 * size_t{t}]),
                     b = find(surface.uv_triangles[3 * size_t{t} + c]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<uint32_t> chart(surface.triangle_count(), kNoChart), number(parent.size(), kNoChart);
  uint32_t count = 0;
  for (uint32_t t = 0; t < surface.triangle_count(); ++t) {
    if (is_hidden(surface, t)) continue;
    uint32_t& known = number[find(surface.uv_triangles[3 * size_t{t}])];
    if (known == kNoChart) known = count++;
    chart[t] = known;
  }
  return chart;
}

std::vector<Chart> find_charts(const Surface& surface) {
  const std::vector<uint32_t> chart_of_triangle = chart_of_triangles(surface);
  std::vector<Chart> charts;
  for (uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const uint32_t number = chart_of_triangle[t];
    if (number == kNoChart) continue;
    if (number == charts.size()) charts.emplace_back();
    charts[number].triangles.push_back(t);
    charts[number].surface_m2 += surface_area(surface, t);
    charts[number].uv_area += uv_area(surface, t);
  }
  for (Chart& chart : charts) chart.part = most_of(surface, chart);
  return charts;
}

Surface pack_atlas(const Surface& surface, const AtlasOptions& options) {
  const std::vector<Chart> charts = find_charts(surface);
  check_options(charts, options);
  std::vector<FlatChart> flat;
  std::vector<double> sizes;
  for (const Chart& chart : charts) {
    const double size = sizes.emplace_back(chart_size(chart, options));
    FlatChart& out = flat.emplace_back();
    for (uint32_t t : chart.triangles) {
      for (size_t c = 0; c < 3; ++c) {
        const Point2 p = uv_corner(surface, t, c);
        out.corners.push_back({p[0] * size, p[1] * size});
      }
    }
  }
  // A cell counts as covered if one of its texels is. Charts farther apart than three cells less a
  // texel cover texels three cells apart or more, and so cells with two others between.
  const double cell = 1.0 / options.coarsest_grid, texel = 1.0 / options.uv_size;
  const std::optional<Packing> packing =
      pack_charts(flat, {.gap = 3 * cell - texel,
                         .margin = cell,
                         .cells = std::min(4 * options.coarsest_grid, kMostCells),
                         .attempts = options.attempts});
  if (!packing) {
    throw InputError("atlas: " + std::to_string(charts.size()) +
                     " charts do not fit with two cells of a grid of " +
                     std::to_string(options.coarsest_grid) + " between them");
  }
  return placed(surface, charts, sizes, *packing);
}

}  // namespace figurine::body
