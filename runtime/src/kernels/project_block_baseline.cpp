// World-space Gaussians to splats of the image, one at a time: cull, project, evaluate the colour
// seen from the camera. The specification of every other kernel.
//
// Based on: Zwicker et al., EWA Splatting, 2002, eq. 26-31 (the Jacobian of the perspective map),
// in the form of docs/numerics.md, "Splatting".
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

// Real spherical harmonics in the sign convention of the original 3DGS (figurine/gaussian.h).
constexpr float kSh0 = 0.28209479177387814f;
constexpr float kSh1 = 0.4886025119029199f;
constexpr float kSh2[5] = {1.0925484305920792f, -1.0925484305920792f, 0.31539156525252005f,
                           -1.0925484305920792f, 0.5462742152960396f};
constexpr float kSh3[7] = {-0.5900435899266435f, 2.890611442640554f,   -0.4570457994644658f,
                           0.3731763325901154f,  -0.4570457994644658f, 1.445305721320277f,
                           -0.5900435899266435f};

// Slack of the bounds that only save work: the pixel test decides, these may be too large but never
// too small.
constexpr float kReachSlack =
    1e-3f;  // in log2 of alpha, a thousand times the rounding of the blend
constexpr float kBoxSlackPx = 1e-3f;
constexpr float kBoxSlackRatio = 1.0001f;

float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

float clamp(float value, float low, float high) {
  value = value < low ? low : value;
  return high < value ? high : value;
}

// The basis up to the degree in a unit direction; returns the number of its functions.
uint32_t evaluate_basis(uint32_t degree, const float* direction, float* basis) {
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
  return (degree + 1) * (degree + 1);
}

// max(SH(direction) + 0.5, 0) per channel. False if a sum is not finite.
bool evaluate_colour(const ProjectJob& job, uint32_t lane, const float* direction, float* rgb) {
  float basis[16], sum[3] = {0, 0, 0};
  const uint32_t count = evaluate_basis(job.sh_degree, direction, basis);
  for (uint32_t k = 0; k < count; ++k) {
    for (uint32_t c = 0; c < 3; ++c) sum[c] += basis[k] * job.gaussians->sh[3 * k + c][lane];
  }
  for (int c = 0; c < 3; ++c) {
    if (!is_finite(sum[c])) return false;
    const float colour = sum[c] + kShOffset;
    rgb[c] = colour > 0 ? colour : 0;
  }
  return true;
}

uint16_t tile_of(float pixel, uint32_t size) {
  const float last = static_cast<float>(size - 1);
  const float clamped = pixel > 0 ? (pixel < last ? pixel : last) : 0;
  return static_cast<uint16_t>(static_cast<uint32_t>(clamped) / uint32_t{kTileSize});
}

enum class Lane : uint32_t { kVisible, kTransparent, kOutside, kBehindOrNotFinite };

Lane project_lane(const ProjectJob& job, uint32_t lane) {
  const View& view = *job.view;
  const GaussianBlock& gaussians = *job.gaussians;
  const float opacity = gaussians.opacity[lane];
  if (!(opacity > 0) || !is_finite(opacity)) return Lane::kBehindOrNotFinite;
  if (opacity < view.alpha_cut && (job.leave_out & kLeaveOutTransparent) != 0) {
    return Lane::kTransparent;
  }

  const float* m = view.view_from_world;
  float position[3], seen[3];
  for (int i = 0; i < 3; ++i) position[i] = gaussians.position_m[i][lane];
  for (int i = 0; i < 3; ++i) {
    seen[i] = (m[4 * i] * position[0] + m[4 * i + 1] * position[1]) +
              (m[4 * i + 2] * position[2] + m[4 * i + 3]);
  }
  const float z = seen[2];
  if (!(z > view.near_m)) return Lane::kBehindOrNotFinite;  // written so that NaN is culled too
  const float tan_x = seen[0] / z, tan_y = seen[1] / z;
  const float mean_x = view.fx_px * tan_x + view.cx_px, mean_y = view.fy_px * tan_y + view.cy_px;

  // Rows u, v of the projected factor J R F; the 2D covariance is their Gram matrix plus the
  // dilation.
  const float clamped_x = clamp(tan_x, view.tan_x_min, view.tan_x_max);
  const float clamped_y = clamp(tan_y, view.tan_y_min, view.tan_y_max);
  const float focal_x = view.fx_px / z, focal_y = view.fy_px / z;
  float u[3], v[3];
  for (int k = 0; k < 3; ++k) {
    const float f0 = gaussians.factor[k][lane], f1 = gaussians.factor[3 + k][lane],
                f2 = gaussians.factor[6 + k][lane];
    const float gx = m[0] * f0 + m[1] * f1 + m[2] * f2;
    const float gy = m[4] * f0 + m[5] * f1 + m[6] * f2;
    const float gz = m[8] * f0 + m[9] * f1 + m[10] * f2;
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
  if (!is_finite(mean_x) || !is_finite(mean_y) || !is_finite(a) || !is_finite(b) || !is_finite(c) ||
      !is_finite(determinant)) {
    return Lane::kBehindOrNotFinite;
  }

  // Where alpha can reach the cut. reach = log2(opacity / cut); 2 ln(opacity / cut) = 2 ln 2 reach.
  // What is below the cut has a reach of nothing but slack.
  constexpr float kTwoLn2 = 1.38629436f;
  const float log2_ratio = log2_float(opacity / view.alpha_cut);
  const float reach = (log2_ratio > 0 ? log2_ratio : 0.0f) + kReachSlack;
  // In standard deviations; apart from a and c, so that nothing overflows.
  const float radius = __builtin_sqrtf(kTwoLn2 * reach) * kBoxSlackRatio;
  const float half_width = radius * __builtin_sqrtf(a) + kBoxSlackPx;
  const float half_height = radius * __builtin_sqrtf(c) + kBoxSlackPx;
  const float width = static_cast<float>(view.width_px),
              height = static_cast<float>(view.height_px);
  // Pixel centres lie between 0.5 and size - 0.5.
  const float left = mean_x - half_width, right = mean_x + half_width, top = mean_y - half_height,
              bottom = mean_y + half_height;
  const bool touches =
      left <= width - 0.5f && right >= 0.5f && top <= height - 0.5f && bottom >= 0.5f;
  if (!touches && (job.leave_out & kLeaveOutOutside) != 0) return Lane::kOutside;

  float direction[3], rgb[3];
  for (int k = 0; k < 3; ++k) direction[k] = position[k] - view.camera_centre_m[k];
  const float inverse_length = 1.0f / __builtin_sqrtf(dot(direction, direction));
  for (int k = 0; k < 3; ++k) direction[k] *= inverse_length;
  if (!evaluate_colour(job, lane, direction, rgb)) return Lane::kBehindOrNotFinite;

  constexpr float kLog2E = 1.44269504f;
  const float scale_u = __builtin_sqrtf(c / determinant * (0.5f * kLog2E));
  job.splats[lane] = {.mean_x = mean_x,
                      .mean_y = mean_y,
                      .slope = b / c,
                      .scale_u = scale_u,
                      .scale_v = __builtin_sqrtf(0.5f * kLog2E / c),
                      .inverse_scale_u = 1.0f / scale_u,
                      .reach = reach,
                      .half_height = half_height,
                      .opacity = opacity,
                      .red = rgb[0],
                      .green = rgb[1],
                      .blue = rgb[2],
                      .widest_dy_px = b / a * half_width,
                      .tile_x_begin = tile_of(left, view.width_px),
                      .tile_y_begin = tile_of(top, view.height_px),
                      .tile_x_last = tile_of(right, view.width_px),
                      .tile_y_last = tile_of(bottom, view.height_px)};
  job.depth_m[lane] = z;
  return Lane::kVisible;
}

}  // namespace

ProjectedLanes project_block_baseline(const ProjectJob& job) {
  ProjectedLanes lanes{0, 0, 0};
  for (uint32_t lane = 0; lane < job.count; ++lane) {
    const Lane result = project_lane(job, lane);
    lanes.visible |= uint32_t{result == Lane::kVisible} << lane;
    lanes.transparent |= uint32_t{result == Lane::kTransparent} << lane;
    lanes.outside |= uint32_t{result == Lane::kOutside} << lane;
  }
  return lanes;
}

}  // namespace figurine::kernels
