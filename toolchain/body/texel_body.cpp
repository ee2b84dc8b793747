#include "toolchain/body/texel_body.h"

#include <algorithm>
#include <cmath>

#include "toolchain/body/skin.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

constexpr uint32_t kNone = 0xffffffffu;
constexpr double kMinSpacingM =
    1e-5;  // a UV map that squeezes texels to a point still needs a positive scale

struct Coverage {
  std::vector<uint32_t> triangle;                 // [T*T] or kNone
  std::vector<std::array<float, 3>> barycentric;  // [T*T]
};

// Twice the signed area of the triangle a, b, p in UV.
double edge(const double* a, const double* b, const double* p) {
  return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

struct UvTriangle {
  double corner[3][2];
  double area2 = 0;  // twice the signed area
};

UvTriangle uv_triangle(const Surface& surface, uint32_t t) {
  UvTriangle out;
  for (int c = 0; c < 3; ++c) {
    const size_t index = size_t{surface.uv_triangles[3 * size_t{t} + c]} * 2;
    out.corner[c][0] = surface.uv[index];
    out.corner[c][1] = surface.uv[index + 1];
  }
  out.area2 = edge(out.corner[0], out.corner[1], out.corner[2]);
  return out;
}

Coverage rasterise(const Surface& surface, uint32_t size) {
  Coverage coverage{std::vector<uint32_t>(size_t{size} * size, kNone),
                    std::vector<std::array<float, 3>>(size_t{size} * size)};
  for (uint32_t t = 0; t < surface.triangle_count(); ++t) {
    if (!surface.hidden.empty() && surface.hidden[t]) continue;
    const UvTriangle uv = uv_triangle(surface, t);
    double low[2] = {1e30, 1e30}, high[2] = {-1e30, -1e30};
    for (const auto& corner : uv.corner) {
      for (int i = 0; i < 2; ++i) {
        if (!(corner[i] >= 0 && corner[i] <= 1))
          throw InputError("surface: uv: triangle " + std::to_string(t) + " leaves [0,1]");
        low[i] = std::min(low[i], corner[i]);
        high[i] = std::max(high[i], corner[i]);
      }
    }
    if (std::abs(uv.area2) < 1e-14) continue;
    // Texel centres (u + 0.5) / T within the bounding box.
    const auto first = [&](double x) {
      return static_cast<uint32_t>(std::clamp(std::ceil(x * size - 0.5), 0.0, double(size)));
    };
    const auto end = [&](double x) {
      return static_cast<uint32_t>(std::clamp(std::floor(x * size - 0.5) + 1, 0.0, double(size)));
    };
    for (uint32_t v = first(low[1]); v < end(high[1]); ++v) {
      for (uint32_t u = first(low[0]); u < end(high[0]); ++u) {
        const size_t texel = size_t{v} * size + u;
        if (coverage.triangle[texel] != kNone) continue;
        const double p[2] = {(u + 0.5) / size, (v + 0.5) / size};
        const double b[3] = {edge(uv.corner[1], uv.corner[2], p) / uv.area2,
                             edge(uv.corner[2], uv.corner[0], p) / uv.area2,
                             edge(uv.corner[0], uv.corner[1], p) / uv.area2};
        if (b[0] < 0 || b[1] < 0 || b[2] < 0) continue;
        coverage.triangle[texel] = t;
        coverage.barycentric[texel] = {static_cast<float>(b[0]), static_cast<float>(b[1]),
                                       static_cast<float>(b[2])};
      }
    }
  }
  return coverage;
}

// Mean length on the surface of one texel step along u and along v, from the Jacobian of the
// triangle's map. Unlike the distance to the neighbouring texel it does not jump where two fingers
// lie side by side in the map.
double texel_spacing(const Surface& surface, uint32_t t, uint32_t size) {
  const UvTriangle uv = uv_triangle(surface, t);
  const double du1 = uv.corner[1][0] - uv.corner[0][0], dv1 = uv.corner[1][1] - uv.corner[0][1];
  const double du2 = uv.corner[2][0] - uv.corner[0][0], dv2 = uv.corner[2][1] - uv.corner[0][1];
  const float* p[3];
  for (int c = 0; c < 3; ++c)
    p[c] = &surface.position_m[size_t{surface.triangles[3 * size_t{t} + c]} * 3];
  double along_u = 0, along_v = 0;
  for (int i = 0; i < 3; ++i) {
    const double e1 = double{p[1][i]} - p[0][i], e2 = double{p[2][i]} - p[0][i];
    const double per_u = (e1 * dv2 - e2 * dv1) / uv.area2, per_v = (e2 * du1 - e1 * du2) / uv.area2;
    along_u += per_u * per_u;
    along_v += per_v * per_v;
  }
  return std::max(0.5 * (std::sqrt(along_u) + std::sqrt(along_v)) / size, kMinSpacingM);
}

// Border texels and the covered rows they repeat: the nearest, and of equally near ones the lowest
// row.
void dilate(TexelBody& body, const std::vector<uint32_t>& row_of_texel) {
  const int size = static_cast<int>(body.uv_size);
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) {
      if (row_of_texel[static_cast<size_t>(v) * size + u] != kNone) continue;
      int best_distance = 0;
      uint32_t best = kNone;
      for (int dv = -kBorderTexels; dv <= kBorderTexels; ++dv) {
        for (int du = -kBorderTexels; du <= kBorderTexels; ++du) {
          const int nu = u + du, nv = v + dv;
          if (nu < 0 || nv < 0 || nu >= size || nv >= size) continue;
          const uint32_t row = row_of_texel[static_cast<size_t>(nv) * size + nu];
          if (row == kNone) continue;
          const int distance = du * du + dv * dv;
          if (best == kNone || distance < best_distance ||
              (distance == best_distance && row < best)) {
            best = row;
            best_distance = distance;
          }
        }
      }
      if (best == kNone) continue;
      body.border_texel.push_back(static_cast<uint32_t>(v * size + u));
      body.border_source.push_back(best);
    }
  }
}

}  // namespace

figurine::Body TexelBody::view() const {
  figurine::Body out;
  out.name = name;
  out.uv_size = uv_size;
  out.joint_names = body::joint_names();
  out.parents = joint_parents();
  out.joint_position_m = joint_m;
  out.joint_shape_basis_m = joint_shape_basis_m;
  out.texel = texel;
  out.texel_position_m = position_m;
  out.texel_normal = normal;
  out.texel_joints = joints;
  out.texel_weights = weights;
  out.texel_spacing_m = spacing_m;
  out.texel_shape_basis_m = shape_basis_m;
  out.border_texel = border_texel;
  out.border_source = border_source;
  if (states_mesh_places) {
    out.texel_triangle = triangle;
    out.texel_barycentric = barycentric;
  }
  return out;
}

TexelBody make_texel_body(const BodyModel& model, uint32_t uv_size) {
  if (uv_size < 8 || uv_size > kMaxUvSize)
    throw InputError("uv size " + std::to_string(uv_size) + ": not within 8 and 1024");
  const Surface& surface = model.surface;
  const Coverage coverage = rasterise(surface, uv_size);
  const std::vector<float> normals = vertex_normals(surface.position_m, surface.triangles);

  TexelBody body;
  body.name = model.name;
  body.uv_size = uv_size;
  body.shape_count = model.shape_count;
  body.joint_m = model.joint_m;
  body.joint_shape_basis_m = model.joint_shape_basis_m;
  std::vector<uint32_t> row_of_texel(coverage.triangle.size(), kNone);
  for (size_t texel = 0; texel < coverage.triangle.size(); ++texel) {
    const uint32_t t = coverage.triangle[texel];
    if (t == kNone) continue;
    row_of_texel[texel] = static_cast<uint32_t>(body.texel.size());
    body.texel.push_back(static_cast<uint32_t>(texel));
    body.triangle.push_back(t);
    double n[3] = {0, 0, 0};
    SkinAccumulator skin;
    double position[3] = {0, 0, 0};
    for (int c = 0; c < 3; ++c) {
      const size_t vertex = surface.triangles[3 * size_t{t} + c];
      const double b = coverage.barycentric[texel][c];
      body.barycentric.push_back(coverage.barycentric[texel][c]);
      for (int i = 0; i < 3; ++i) {
        position[i] += b * surface.position_m[3 * vertex + i];
        n[i] += b * normals[3 * vertex + i];
      }
      for (uint32_t k = 0; k < kSkinInfluences; ++k) {
        const float w = surface.skin_weights[vertex * kSkinInfluences + k];
        if (w > 0) skin.add(surface.skin_joints[vertex * kSkinInfluences + k], b * w);
      }
    }
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; ++i) {
      body.position_m.push_back(static_cast<float>(position[i]));
      body.normal.push_back(length > 1e-6 ? static_cast<float>(n[i] / length)
                                          : (i == 2 ? 1.0f : 0.0f));
    }
    uint8_t joints[kSkinInfluences];
    float weights[kSkinInfluences];
    body.largest_lost_weight = std::max(body.largest_lost_weight, skin.store(joints, weights));
    body.most_influences =
        std::max(body.most_influences, static_cast<uint32_t>(skin.influence_count()));
    body.joints.insert(body.joints.end(), joints, joints + kSkinInfluences);
    body.weights.insert(body.weights.end(), weights, weights + kSkinInfluences);
    body.spacing_m.push_back(static_cast<float>(texel_spacing(surface, t, uv_size)));
  }
  if (body.texel.empty())
    throw InputError("surface: uv: no texel of " + std::to_string(uv_size) + " is covered");

  body.shape_basis_m.reserve(size_t{model.shape_count} * body.texel.size() * 3);
  for (uint32_t s = 0; s < model.shape_count; ++s) {
    const float* direction =
        model.vertex_shape_basis_m.data() + size_t{s} * surface.position_m.size();
    for (size_t row = 0; row < body.texel.size(); ++row) {
      for (int i = 0; i < 3; ++i) {
        double sum = 0;
        for (int c = 0; c < 3; ++c) {
          sum += double{body.barycentric[3 * row + c]} *
                 direction[3 * size_t{surface.triangles[3 * size_t{body.triangle[row]} + c]} + i];
        }
        body.shape_basis_m.push_back(static_cast<float>(sum));
      }
    }
  }
  dilate(body, row_of_texel);
  return body;
}

}  // namespace figurine::body
