#include "toolchain/capture/strain.h"

#include <algorithm>
#include <cmath>

namespace figurine::capture {
namespace {

constexpr float kSmallestArea_m2 = 1e-9f;  // of a face: a hundredth of a millimetre by a tenth
constexpr float kLargestStrain =
    1.0f;  // a stretch to 1.7 times the length; slivers show far more and mean nothing
constexpr float kSmallestStretch2 =
    0.04f;  // squared: a surface is never taken for shorter than a fifth of its length
constexpr int kSmoothings = 8;

}  // namespace

StrainGauge::StrainGauge(std::span<const float> rest_m, std::span<const uint32_t> triangles)
    : area_(rest_m.size() / 3, 0.0f) {
  std::vector<std::array<uint32_t, 2>> edges;
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    Face face{.vertex = {triangles[t], triangles[t + 1], triangles[t + 2]}};
    for (int k = 0; k < 3; ++k) {
      edges.push_back({face.vertex[k], face.vertex[(k + 1) % 3]});
      edges.push_back({face.vertex[(k + 1) % 3], face.vertex[k]});
    }
    const Vec3 p = load(&rest_m[size_t{face.vertex[0]} * 3]);
    const Vec3 e1 = load(&rest_m[size_t{face.vertex[1]} * 3]) - p,
               e2 = load(&rest_m[size_t{face.vertex[2]} * 3]) - p;
    const Vec3 normal = cross(e1, e2);
    face.area = length(normal) / 2;
    if (!(face.area > kSmallestArea_m2)) continue;
    face.a = normalized(e1);
    face.b = cross(normalized(normal), face.a);
    const float m11 = dot(e1, face.a), m12 = dot(e2, face.a), m22 = dot(e2, face.b);
    face.i11 = 1 / m11, face.i22 = 1 / m22, face.i12 = -m12 / (m11 * m22);
    for (uint32_t v : face.vertex) area_[v] += face.area;
    faces_.push_back(face);
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  neighbour_start_.assign(area_.size() + 1, 0);
  for (const auto& edge : edges) {
    ++neighbour_start_[edge[0] + 1];
    neighbour_.push_back(edge[1]);
  }
  for (size_t v = 0; v < area_.size(); ++v) neighbour_start_[v + 1] += neighbour_start_[v];
}

std::vector<Strain> StrainGauge::measure(std::span<const float> posed_m) const {
  std::vector<Strain> out(area_.size());
  for (const Face& face : faces_) {
    const Vec3 p = load(&posed_m[size_t{face.vertex[0]} * 3]);
    const Vec3 e1 = load(&posed_m[size_t{face.vertex[1]} * 3]) - p,
               e2 = load(&posed_m[size_t{face.vertex[2]} * 3]) - p;
    const Vec3 f1 = e1 * face.i11,
               f2 = e1 * face.i12 + e2 * face.i22;  // columns of the deformation gradient
    float e11 = (dot(f1, f1) - 1) / 2, e12 = dot(f1, f2) / 2, e22 = (dot(f2, f2) - 1) / 2;
    const float size = std::sqrt(e11 * e11 + 2 * e12 * e12 + e22 * e22);
    if (!std::isfinite(size)) continue;
    const float scale = size > kLargestStrain ? kLargestStrain / size : 1.0f;
    e11 *= scale, e12 *= scale, e22 *= scale;
    const Vec3 diagonal = face.a + face.b;
    // a b^T + b a^T = (a + b)(a + b)^T - a a^T - b b^T
    const Strain strain =
        outer(face.a, e11 - e12) + outer(face.b, e22 - e12) + outer(diagonal, e12);
    for (uint32_t v : face.vertex) out[v] = out[v] + strain * face.area;
  }
  for (size_t v = 0; v < out.size(); ++v)
    out[v] = area_[v] > 0 ? out[v] * (1 / area_[v]) : Strain{};
  std::vector<Strain> before;
  for (int pass = 0; pass < kSmoothings; ++pass) {
    before = out;
    for (size_t v = 0; v < out.size(); ++v) {
      const uint32_t first = neighbour_start_[v], end = neighbour_start_[v + 1];
      if (first == end) continue;
      Strain sum;
      for (uint32_t i = first; i < end; ++i) sum = sum + before[neighbour_[i]];
      out[v] = before[v] * 0.5f + sum * (0.5f / static_cast<float>(end - first));
    }
  }
  return out;
}

Compression principal_compression(const Strain& strain, Vec3 a, Vec3 b) {
  const float p = contract(strain, a, a), q = contract(strain, a, b), s = contract(strain, b, b);
  const float middle = (p + s) / 2, half = (p - s) / 2, radius = std::sqrt(half * half + q * q);
  const auto lost = [](float e) {
    return std::max(0.0f, 1 - std::sqrt(std::max(1 + 2 * e, kSmallestStretch2)));
  };
  Compression out{.along = lost(middle - radius), .across = lost(middle + radius), .direction = a};
  if (radius > 0) {
    // The most stretched direction lies at half the angle of (half, q); the most compressed one at
    // right angles to it.
    const float cosine = std::sqrt(std::max(0.0f, (1 + half / radius) / 2));
    const float sine = std::copysign(std::sqrt(std::max(0.0f, (1 - half / radius) / 2)), q);
    out.direction = b * cosine - a * sine;
  }
  return out;
}

}  // namespace figurine::capture
