#include <algorithm>
#include <cmath>

#include "bench/peers/peer.h"

namespace figurine::peers {
namespace {

constexpr float kNear = 0.2f, kDilation = 0.3f;

// Rows of R F, F the covariance's factor.
void view_factor(const Camera& camera, const float* factor, float (&out)[3][3]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out[i][j] = 0;
      for (int k = 0; k < 3; ++k)
        out[i][j] += camera.view_from_world[size_t(4 * i + k)] * factor[3 * k + j];
    }
  }
}

}  // namespace

void project(const GaussianView& gaussians, const Camera& camera, std::vector<Projected>& out) {
  out.clear();
  const float width = static_cast<float>(camera.width_px),
              height = static_cast<float>(camera.height_px);
  const float limit_x = 1.3f * 0.5f * width / camera.fx_px,
              limit_y = 1.3f * 0.5f * height / camera.fy_px;
  const size_t values = 3 * sh_coefficients(gaussians.sh_degree);
  for (size_t i = 0; i < gaussians.count; ++i) {
    const float* p = gaussians.position_m.data() + 3 * i;
    float v[3];
    for (size_t k = 0; k < 3; ++k) {
      const float* row = camera.view_from_world.data() + 4 * k;
      v[k] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
    }
    if (!(v[2] > kNear)) continue;
    const float inverse_z = 1 / v[2];
    const float tx = std::clamp(v[0] * inverse_z, -limit_x, limit_x),
                ty = std::clamp(v[1] * inverse_z, -limit_y, limit_y);
    float g[3][3];
    view_factor(camera, gaussians.covariance_factor.data() + 9 * i, g);
    float xx = kDilation, xy = 0, yy = kDilation;
    for (int k = 0; k < 3; ++k) {
      const float u = camera.fx_px * inverse_z * (g[0][k] - tx * g[2][k]),
                  w = camera.fy_px * inverse_z * (g[1][k] - ty * g[2][k]);
      xx += u * u, xy += u * w, yy += w * w;
    }
    const float determinant = xx * yy - xy * xy;
    if (!(determinant > 0)) continue;
    const float mean = 0.5f * (xx + yy),
                widest = mean + std::sqrt(std::max(0.1f, mean * mean - determinant));
    Projected projected{.x = camera.fx_px * v[0] * inverse_z + camera.cx_px,
                        .y = camera.fy_px * v[1] * inverse_z + camera.cy_px,
                        .a = yy / determinant,
                        .b = -xy / determinant,
                        .c = xx / determinant,
                        .radius = std::ceil(3 * std::sqrt(widest)),
                        .depth = v[2],
                        .opacity = gaussians.opacity[i],
                        .red = 0,
                        .green = 0,
                        .blue = 0};
    if (projected.x + projected.radius < 0 || projected.x - projected.radius > width ||
        projected.y + projected.radius < 0 || projected.y - projected.radius > height) {
      continue;
    }
    const float* sh = gaussians.sh.data() + values * i;
    projected.red = std::max(kSh0 * sh[0] + kShOffset, 0.0f);
    projected.green = std::max(kSh0 * sh[1] + kShOffset, 0.0f);
    projected.blue = std::max(kSh0 * sh[2] + kShOffset, 0.0f);
    out.push_back(projected);
  }
}

}  // namespace figurine::peers
