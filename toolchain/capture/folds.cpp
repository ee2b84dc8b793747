#include "toolchain/capture/folds.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "toolchain/body/surface.h"
#include "toolchain/random/counter.h"

namespace figurine::capture {

using random::CounterRandom;

namespace {

constexpr uint64_t kPlaceStream = 1, kSizeStream = 2;

// A crease in the coordinates u across and v along it: height (1 - 9 s)(1 - s - t)^3 with s = (u /
// across)^2, t = (v / along)^2. Its ridge is half a wavelength wide and its sides dip below the
// surface so that the mean across it is zero, which 9 and 3/4 of a wavelength give exactly.
constexpr float kAcross = 0.75f, kAlong = 2.2f;  // wavelengths from the centre to where it ends
constexpr float kDip = 9;
// Integral of the squared height over the unit disc, pi (1/7 - 18/112 + 81/672).
constexpr float kCreaseEnergy = 0.32257f;

constexpr float kSpacing = 0.75f;          // least distance of creases, wavelengths
constexpr float kPointsPerWavelength = 8;  // of the lattice
constexpr float kOnset = 0.015f;   // compression that cloth takes up before it folds freely; makes
                                   // the square root smooth at zero
constexpr float kSteepest = 1.1f;  // slopes stay below
constexpr float kLargestRoot = 0.65f;        // of the compression that a fold still answers
constexpr float kInvisibleHeight_m = 2e-6f;  // creases below are passed over

Vec3 any_perpendicular(Vec3 n) {
  const Vec3 other = std::fabs(n.x) < 0.6f ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return normalized(cross(n, other));
}

// Height over wavelength of a sine that a strip of cloth compressed by c must have to keep its
// length: sqrt(c) / pi to first order.
float relative_height(float compression) {
  const float root = compression / std::sqrt(compression + kOnset);
  return root / std::sqrt(1 + root * root / (kLargestRoot * kLargestRoot)) / 3.14159265f;
}

template <class T>
T at_corners(const std::vector<T>& values, const std::array<uint32_t, 3>& v, float b1, float b2) {
  return values[v[0]] * (1 - b1 - b2) + values[v[1]] * b1 + values[v[2]] * b2;
}

}  // namespace

const char* to_string(FoldMode mode) {
  switch (mode) {
    case FoldMode::kPose:
      return "pose";
    case FoldMode::kRest:
      return "rest";
    case FoldMode::kOff:
      return "off";
  }
  return "";
}

FoldPattern::FoldPattern(const Mesh& mesh, const FoldStyle& style, uint64_t seed)
    : style_(style), gauge_(mesh.position_m, mesh.triangles) {
  const std::vector<float> normals = body::vertex_normals(mesh.position_m, mesh.triangles);
  const float step_m = style.wavelength_m / kPointsPerWavelength;
  for (uint32_t f = 0; f < mesh.triangle_count(); ++f) {
    Cell cell;
    std::copy_n(&mesh.triangles[size_t{f} * 3], 3, cell.vertex.begin());
    Vec3 p[3], n[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = load(&mesh.position_m[size_t{cell.vertex[k]} * 3]);
      n[k] = load(&normals[size_t{cell.vertex[k]} * 3]);
    }
    const float longest = std::max({length(p[1] - p[0]), length(p[2] - p[1]), length(p[0] - p[2])});
    cell.n = static_cast<uint32_t>(std::clamp(std::ceil(longest / step_m), 1.0f, 24.0f));
    cell.first = static_cast<uint32_t>(position_.size());
    cell.centre = (p[0] + p[1] + p[2]) * (1.0f / 3);
    for (const Vec3& corner : p) cell.radius = std::max(cell.radius, length(corner - cell.centre));
    for (uint32_t j = 0; j <= cell.n; ++j) {
      for (uint32_t i = 0; i + j <= cell.n; ++i) {
        const float b1 = static_cast<float>(i) / static_cast<float>(cell.n),
                    b2 = static_cast<float>(j) / static_cast<float>(cell.n);
        position_.push_back(p[0] * (1 - b1 - b2) + p[1] * b1 + p[2] * b2);
        normal_.push_back(normalized(n[0] * (1 - b1 - b2) + n[1] * b1 + n[2] * b2));
      }
    }
    cells_.push_back(cell);
  }
  if (mesh.fold_strength.size() == mesh.vertex_count() && style.strength > 0)
    place_creases(mesh, normals, seed);
}

// Creases at random places of the surface, by area, none nearer to another than kSpacing (dart
// throwing).
void FoldPattern::place_creases(const Mesh& mesh, const std::vector<float>& normals,
                                uint64_t seed) {
  std::vector<double> area_until;
  double area = 0;
  for (const Cell& cell : cells_) {
    const Vec3 p = load(&mesh.position_m[size_t{cell.vertex[0]} * 3]);
    const Vec3 normal = cross(load(&mesh.position_m[size_t{cell.vertex[1]} * 3]) - p,
                              load(&mesh.position_m[size_t{cell.vertex[2]} * 3]) - p);
    area_until.push_back(area += double{length(normal)} / 2);
  }
  if (!(area > 0)) return;
  const CounterRandom place(seed, kPlaceStream), size(seed, kSizeStream);
  const float spacing_m = kSpacing * style_.wavelength_m;
  const auto darts = static_cast<uint64_t>(4 * area / double{spacing_m * spacing_m});
  // Darts that landed, by boxes of one spacing: only the 27 around a dart can be too near.
  std::map<std::array<int, 3>, std::vector<uint32_t>> boxes;
  const auto box_of = [&](Vec3 p) {
    return std::array<int, 3>{static_cast<int>(std::floor(p.x / spacing_m)),
                              static_cast<int>(std::floor(p.y / spacing_m)),
                              static_cast<int>(std::floor(p.z / spacing_m))};
  };
  const auto free = [&](Vec3 p, Vec3 n) {
    const std::array<int, 3> box = box_of(p);
    for (int i = 0; i < 27; ++i) {
      const auto found =
          boxes.find({box[0] + i % 3 - 1, box[1] + i / 3 % 3 - 1, box[2] + i / 9 - 1});
      if (found == boxes.end()) continue;
      for (uint32_t other : found->second) {
        // The far side of a thin fold of the mesh is another place.
        if (dot(creases_[other].normal, n) > 0 && length(creases_[other].centre - p) < spacing_m)
          return false;
      }
    }
    return true;
  };
  for (uint64_t dart = 0; dart < darts; ++dart) {
    const auto hit =
        std::upper_bound(area_until.begin(), area_until.end(), area * place.unit(3 * dart));
    const auto f = static_cast<uint32_t>(
        std::min<size_t>(static_cast<size_t>(hit - area_until.begin()), cells_.size() - 1));
    const double root = std::sqrt(place.unit(3 * dart + 1)), along = place.unit(3 * dart + 2);
    Crease crease{.triangle = f,
                  .b1 = static_cast<float>(root * (1 - along)),
                  .b2 = static_cast<float>(root * along)};
    const std::array<uint32_t, 3>& v = cells_[f].vertex;
    const auto mixed = [&](const std::vector<float>& values) {
      return load(&values[size_t{v[0]} * 3]) * (1 - crease.b1 - crease.b2) +
             load(&values[size_t{v[1]} * 3]) * crease.b1 +
             load(&values[size_t{v[2]} * 3]) * crease.b2;
    };
    crease.centre = mixed(mesh.position_m);
    crease.normal = normalized(mixed(normals));
    if (!free(crease.centre, crease.normal)) continue;
    crease.a = any_perpendicular(crease.normal);
    crease.b = cross(crease.normal, crease.a);
    crease.wavelength_m =
        style_.wavelength_m * static_cast<float>(size.uniform(2 * dart, 0.55, 1.45));
    crease.gain = style_.strength * at_corners(mesh.fold_strength, v, crease.b1, crease.b2) *
                  static_cast<float>(size.uniform(2 * dart + 1, 0.1, 1.0));
    boxes[box_of(crease.centre)].push_back(static_cast<uint32_t>(creases_.size()));
    creases_.push_back(crease);
  }
  // Overlapping creases of height 1 have a mean square of density x energy; a sine has 1/2. The
  // mean square of the chance in `gain` is 0.37.
  const double density = static_cast<double>(creases_.size()) / area;
  for (Crease& crease : creases_) {
    const double square = density * 0.37 * double{kCreaseEnergy} * double{kAcross} *
                          double{kAlong} * double{crease.wavelength_m} *
                          double{crease.wavelength_m};
    crease.gain *= static_cast<float>(std::sqrt(0.5 / square));
  }
  std::erase_if(creases_, [](const Crease& crease) { return !(crease.gain > 0); });
  for (Crease& crease : creases_) {
    crease.first_near = static_cast<uint32_t>(near_.size());
    const float reach = kAlong * crease.wavelength_m;
    for (uint32_t f = 0; f < cells_.size(); ++f) {
      const Vec3 way = cells_[f].centre - crease.centre;
      const float limit = reach + cells_[f].radius;
      if (dot(way, way) > limit * limit) continue;
      const bool faces = std::any_of(
          cells_[f].vertex.begin(), cells_[f].vertex.end(),
          [&](uint32_t v) { return dot(load(&normals[size_t{v} * 3]), crease.normal) > 0; });
      if (faces) near_.push_back(f);
    }
    crease.end_near = static_cast<uint32_t>(near_.size());
  }
}

std::vector<FoldSample> FoldPattern::evaluate(std::span<const float> posed_m) const {
  std::vector<FoldSample> out(position_.size());
  const std::vector<Strain> strains = gauge_.measure(posed_m);
  for (const Crease& crease : creases_) {
    const Strain pose = at_corners(strains, cells_[crease.triangle].vertex, crease.b1, crease.b2);
    // The cut's slack hangs down the rest surface: most on upright parts, none on shoulders, which
    // carry the cloth.
    const Vec3 down = Vec3{0, 1, 0} - crease.normal * crease.normal.y;
    const Compression c =
        principal_compression(pose + outer(down, -style_.slack), crease.a, crease.b);
    // Compression that is the same in all directions has none to fold along: what counts is how
    // much more there is along than across.
    const float height = crease.gain * crease.wavelength_m * relative_height(c.along - c.across);
    if (height < kInvisibleHeight_m) continue;
    const Vec3 du = c.direction, dv = cross(crease.normal, du), dw = crease.normal;
    const float reach_u = kAcross * crease.wavelength_m, reach_v = kAlong * crease.wavelength_m;
    const float iu = 1 / (reach_u * reach_u), iv = 1 / (reach_v * reach_v);
    for (uint32_t k = crease.first_near; k < crease.end_near; ++k) {
      const Cell& cell = cells_[near_[k]];
      const Vec3 way = cell.centre - crease.centre;
      if (std::fabs(dot(way, du)) > reach_u + cell.radius ||
          std::fabs(dot(way, dv)) > reach_v + cell.radius)
        continue;
      const uint32_t end = cell.first + (cell.n + 1) * (cell.n + 2) / 2;
      for (uint32_t i = cell.first; i < end; ++i) {
        const Vec3 r = position_[i] - crease.centre;
        const float u = dot(r, du), v = dot(r, dv), w = dot(r, dw);
        const float s = u * u * iu, m = 1 - s - (v * v + w * w) * iv;
        if (m <= 0) continue;
        // The other side of a sleeve or of the gap between the legs looks the other way.
        const float facing = dot(normal_[i], crease.normal);
        if (facing <= 0) continue;
        const float scale = height * std::min(1.0f, facing * facing * (3 - 2 * facing)) * m * m,
                    dip = 1 - kDip * s;
        out[i].height_m += scale * m * dip;
        const float along = -6 * dip * iv * scale;
        out[i].gradient +=
            du * (scale * -u * iu * (2 * kDip * m + 6 * dip)) + dv * (v * along) + dw * (w * along);
      }
    }
  }
  return out;
}

void FoldPattern::turn(std::vector<FoldSample>& samples, std::span<const float> linear) const {
  for (const Cell& cell : cells_) {
    const float* m[3];
    for (int k = 0; k < 3; ++k) m[k] = &linear[size_t{cell.vertex[k]} * 9];
    for (uint32_t j = 0; j <= cell.n; ++j) {
      for (uint32_t i = 0; i + j <= cell.n; ++i) {
        Vec3& g = samples[cell.index(i, j)].gradient;
        const float steep2 = dot(g, g);
        if (steep2 == 0) continue;
        const float b1 = static_cast<float>(i) / static_cast<float>(cell.n),
                    b2 = static_cast<float>(j) / static_cast<float>(cell.n), b0 = 1 - b1 - b2;
        float a[9];
        for (int e = 0; e < 9; ++e) a[e] = b0 * m[0][e] + b1 * m[1][e] + b2 * m[2][e];
        const Vec3 turned{a[0] * g.x + a[1] * g.y + a[2] * g.z,
                          a[3] * g.x + a[4] * g.y + a[5] * g.z,
                          a[6] * g.x + a[7] * g.y + a[8] * g.z};
        const float size2 = dot(turned, turned);
        g = size2 > 0 ? turned * std::sqrt(steep2 / size2 / (1 + steep2 / (kSteepest * kSteepest)))
                      : Vec3{};
      }
    }
  }
}

FoldSample FoldPattern::at(std::span<const FoldSample> samples, uint32_t triangle, float b1,
                           float b2) const {
  const Cell& cell = cells_[triangle];
  const auto n = static_cast<float>(cell.n);
  const float x = std::clamp(b1, 0.0f, 1.0f) * n, y = std::clamp(b2, 0.0f, 1.0f) * n;
  uint32_t j = std::min(static_cast<uint32_t>(y), cell.n - 1),
           i = std::min(static_cast<uint32_t>(x), cell.n - 1 - j);
  float fx = std::min(x - static_cast<float>(i), 1.0f),
        fy = std::min(y - static_cast<float>(j), 1.0f);
  const FoldSample *p = &samples[cell.index(i + 1, j)], *q = &samples[cell.index(i, j + 1)],
                   *o = &samples[cell.index(i, j)];
  float wp = fx, wq = fy;
  if (fx + fy > 1) {
    // The upper of the two triangles, if the lattice has one here; on the long edge, rounding may
    // ask for one beyond it.
    if (i + j + 2 <= cell.n) {
      o = &samples[cell.index(i + 1, j + 1)];
      wp = 1 - fy, wq = 1 - fx;
    } else {
      wp = fx / (fx + fy), wq = fy / (fx + fy);
    }
  }
  const float wo = 1 - wp - wq;
  return {o->height_m * wo + p->height_m * wp + q->height_m * wq,
          o->gradient * wo + p->gradient * wp + q->gradient * wq};
}

}  // namespace figurine::capture
