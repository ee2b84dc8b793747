#include "runtime/src/splat/project.h"

#include <algorithm>
#include <cmath>

#include "runtime/src/base/float_math.h"

namespace figurine {
namespace {

bool finite(float x) { return x - x == 0; }

float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Slack of the bounds that only save work: the pixel test decides, these may be too large but never
// too small.
constexpr float kReachSlack =
    1e-3f;  // in log2 of alpha, a thousand times the rounding of the blend
constexpr float kBoxSlackPx = 1e-3f;
constexpr float kBoxSlackRatio = 1.0001f;

}  // namespace

ViewParameters make_view_parameters(const Camera& camera, float alpha_cut) {
  ViewParameters view;
  view.view_from_world = camera.view_from_world;
  const std::array<float, 12>& m = camera.view_from_world;
  for (size_t k = 0; k < 3; ++k) {
    const double centre =
        -(double(m[k]) * m[3] + double(m[4 + k]) * m[7] + double(m[8 + k]) * m[11]);
    view.camera_centre_m[k] = static_cast<float>(centre);
  }
  view.fx_px = camera.fx_px;
  view.fy_px = camera.fy_px;
  view.cx_px = camera.cx_px;
  view.cy_px = camera.cy_px;
  view.near_m = camera.near_m;
  view.width_px = camera.width_px;
  view.height_px = camera.height_px;
  // The image's own range widened by 0.15 of a side on each side: for a centred principal point the
  // original's 1.3 tan(fov / 2).
  constexpr float kMargin = 0.5f * (kFrustumClamp - 1.0f);
  const float width = static_cast<float>(camera.width_px),
              height = static_cast<float>(camera.height_px);
  view.tan_x_min = -(camera.cx_px + kMargin * width) / camera.fx_px;
  view.tan_x_max = (width - camera.cx_px + kMargin * width) / camera.fx_px;
  view.tan_y_min = -(camera.cy_px + kMargin * height) / camera.fy_px;
  view.tan_y_max = (height - camera.cy_px + kMargin * height) / camera.fy_px;
  view.alpha_cut = alpha_cut;
  return view;
}

bool evaluate_colour(const float* sh, uint32_t degree, const std::array<float, 3>& direction,
                     float* rgb) {
  std::array<float, sh_coefficients(kMaxShDegree)> basis;
  const float x = direction[0], y = direction[1], z = direction[2];
  basis[0] = kSh0;
  if (degree >= 1) {
    basis[1] = -kSh1 * y;
    basis[2] = kSh1 * z;
    basis[3] = -kSh1 * x;
  }
  const float xx = x * x, yy = y * y, zz = z * z;
  if (degree >= 2) {
    basis[4] = kSh2[0] * (x * y);
    basis[5] = kSh2[1] * (y * z);
    basis[6] = kSh2[2] * (2 * zz - xx - yy);
    basis[7] = kSh2[3] * (x * z);
    basis[8] = kSh2[4] * (xx - yy);
  }
  if (degree >= 3) {
    basis[9] = kSh3[0] * y * (3 * xx - yy);
    basis[10] = kSh3[1] * (x * y) * z;
    basis[11] = kSh3[2] * y * (4 * zz - xx - yy);
    basis[12] = kSh3[3] * z * (2 * zz - 3 * xx - 3 * yy);
    basis[13] = kSh3[4] * x * (4 * zz - xx - yy);
    basis[14] = kSh3[5] * z * (xx - yy);
    basis[15] = kSh3[6] * x * (xx - 3 * yy);
  }
  float sum[3] = {0, 0, 0};
  for (uint32_t k = 0; k < sh_coefficients(degree); ++k) {
    for (uint32_t c = 0; c < 3; ++c) sum[c] += basis[k] * sh[3 * k + c];
  }
  for (int c = 0; c < 3; ++c) {
    if (!finite(sum[c])) return false;
    const float colour = sum[c] + kShOffset;
    rgb[c] = colour > 0 ? colour : 0;
  }
  return true;
}

bool project_gaussian(const ViewParameters& view, const GaussianView& gaussians, uint32_t index,
                      kernels::Splat& splat, SplatBox& box, float& depth_m) {
  const float opacity = gaussians.opacity[index];
  if (!(opacity >= view.alpha_cut) || !finite(opacity)) return false;

  const float* position = &gaussians.position_m[size_t(index) * 3];
  const float* m = view.view_from_world.data();
  float seen[3];
  for (int i = 0; i < 3; ++i) {
    seen[i] = (m[4 * i] * position[0] + m[4 * i + 1] * position[1]) +
              (m[4 * i + 2] * position[2] + m[4 * i + 3]);
  }
  const float z = seen[2];
  if (!(z > view.near_m)) return false;  // written so that NaN is culled too
  const float tan_x = seen[0] / z, tan_y = seen[1] / z;
  const float mean_x = view.fx_px * tan_x + view.cx_px, mean_y = view.fy_px * tan_y + view.cy_px;

  // Rows u, v of the projected factor J R F; the 2D covariance is their Gram matrix plus the
  // dilation.
  const float clamped_x = std::min(std::max(tan_x, view.tan_x_min), view.tan_x_max);
  const float clamped_y = std::min(std::max(tan_y, view.tan_y_min), view.tan_y_max);
  const float focal_x = view.fx_px / z, focal_y = view.fy_px / z;
  const float* factor = &gaussians.covariance_factor[size_t(index) * 9];
  float u[3], v[3];
  for (int k = 0; k < 3; ++k) {
    const float gx = m[0] * factor[k] + m[1] * factor[3 + k] + m[2] * factor[6 + k];
    const float gy = m[4] * factor[k] + m[5] * factor[3 + k] + m[6] * factor[6 + k];
    const float gz = m[8] * factor[k] + m[9] * factor[3 + k] + m[10] * factor[6 + k];
    u[k] = focal_x * (gx - clamped_x * gz);
    v[k] = focal_y * (gy - clamped_y * gz);
  }
  const float uu = dot(u, u), vv = dot(v, v);
  const float a = uu + kDilationPx2, b = dot(u, v), c = vv + kDilationPx2;
  // a c - b^2 would cancel for needles. By Cauchy-Binet it is the sum of the squared 2x2 minors of
  // [u; v] and of the dilation's terms: all positive.
  const float minors[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                           u[0] * v[1] - u[1] * v[0]};
  const float determinant =
      dot(minors, minors) + kDilationPx2 * (uu + vv) + kDilationPx2 * kDilationPx2;
  if (!finite(mean_x) || !finite(mean_y) || !finite(a) || !finite(b) || !finite(c) ||
      !finite(determinant))
    return false;

  // Where alpha can reach the cut. reach = log2(opacity / cut); 2 ln(opacity / cut) = 2 ln 2 reach.
  constexpr float kTwoLn2 = 1.38629436f;
  const float reach = log2_float(opacity / view.alpha_cut) + kReachSlack;
  const float radius =
      std::sqrt(kTwoLn2 * reach) *
      kBoxSlackRatio;  // in standard deviations; apart from a and c, so that nothing overflows
  const float half_width = radius * std::sqrt(a) + kBoxSlackPx;
  const float half_height = radius * std::sqrt(c) + kBoxSlackPx;
  const float width = static_cast<float>(view.width_px),
              height = static_cast<float>(view.height_px);
  // Pixel centres lie between 0.5 and size - 0.5.
  const float left = mean_x - half_width, right = mean_x + half_width, top = mean_y - half_height,
              bottom = mean_y + half_height;
  if (!(left <= width - 0.5f && right >= 0.5f && top <= height - 0.5f && bottom >= 0.5f))
    return false;

  std::array<float, 3> direction;
  for (size_t k = 0; k < 3; ++k) direction[k] = position[k] - view.camera_centre_m[k];
  const float inverse_length = 1.0f / std::sqrt(dot(direction.data(), direction.data()));
  for (float& component : direction) component *= inverse_length;
  float rgb[3];
  const size_t sh_stride = size_t(3) * sh_coefficients(gaussians.sh_degree);
  if (!evaluate_colour(&gaussians.sh[index * sh_stride], gaussians.sh_degree, direction, rgb))
    return false;

  constexpr float kLog2E = 1.44269504f;
  const float scale_u = std::sqrt(c / determinant * (0.5f * kLog2E));
  splat = {.mean_x = mean_x,
           .mean_y = mean_y,
           .slope = b / c,
           .scale_u = scale_u,
           .scale_v = std::sqrt(0.5f * kLog2E / c),
           .inverse_scale_u = 1.0f / scale_u,
           .reach = reach,
           .half_height = half_height,
           .opacity = opacity,
           .red = rgb[0],
           .green = rgb[1],
           .blue = rgb[2]};
  const auto tile = [](float pixel, uint32_t size) {
    const float last = static_cast<float>(size - 1);
    const float clamped = pixel > 0 ? (pixel < last ? pixel : last) : 0;
    return static_cast<uint16_t>(static_cast<uint32_t>(clamped) / kernels::kTileSize);
  };
  box = {.tile_x_begin = tile(left, view.width_px),
         .tile_y_begin = tile(top, view.height_px),
         .tile_x_last = tile(right, view.width_px),
         .tile_y_last = tile(bottom, view.height_px),
         .widest_dy_px = b / a * half_width};
  depth_m = z;
  return true;
}

}  // namespace figurine
