#include "toolchain/body/surface.h"

#include <cmath>

namespace figurine::body {

std::vector<float> vertex_normals(std::span<const float> position_m,
                                  std::span<const uint32_t> triangles) {
  std::vector<double> sum(position_m.size(), 0.0);
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    const float* a = &position_m[3 * size_t{triangles[t]}];
    const float* b = &position_m[3 * size_t{triangles[t + 1]}];
    const float* c = &position_m[3 * size_t{triangles[t + 2]}];
    const double e[3] = {double{b[0]} - a[0], double{b[1]} - a[1], double{b[2]} - a[2]};
    const double f[3] = {double{c[0]} - a[0], double{c[1]} - a[1], double{c[2]} - a[2]};
    const double n[3] = {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2],
                         e[0] * f[1] - e[1] * f[0]};  // length: twice the area
    for (int corner = 0; corner < 3; ++corner) {
      for (int i = 0; i < 3; ++i) sum[3 * size_t{triangles[t + corner]} + i] += n[i];
    }
  }
  std::vector<float> normals(position_m.size());
  for (size_t v = 0; v < normals.size(); v += 3) {
    const double length =
        std::sqrt(sum[v] * sum[v] + sum[v + 1] * sum[v + 1] + sum[v + 2] * sum[v + 2]);
    for (int i = 0; i < 3; ++i)
      normals[v + i] =
          length > 0 ? static_cast<float>(sum[v + i] / length) : (i == 2 ? 1.0f : 0.0f);
  }
  return normals;
}

std::vector<float> skin_positions(std::span<const float> position_m,
                                  std::span<const uint8_t> joints, std::span<const float> weights,
                                  std::span<const Affine> world_from_rest) {
  std::vector<float> out(position_m.size());
  for (size_t v = 0; v < position_m.size() / 3; ++v) {
    const Affine transform =
        blend(world_from_rest, &joints[v * kSkinInfluences], &weights[v * kSkinInfluences]);
    const std::array<float, 3> p = transform_point(transform, &position_m[3 * v]);
    for (int i = 0; i < 3; ++i) out[3 * v + i] = p[i];
  }
  return out;
}

}  // namespace figurine::body
