// World-space Gaussians to splats of the image, one at a time: cull, project, evaluate the colour
// seen from the camera. The specification of every other kernel.
//
// Based on: Zwicker et al., EWA Splatting, 2002, eq. 26-31 (the Jacobian of the perspective map);
// Yu et al., Mip-Splatting, 2024 (the 2D filter of `antialiased`); in the form of
// docs/numerics.md, "Splatting".
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

#include "runtime/src/kernels/projection_constants.inc"

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

// Where a centre is seen.
struct Centre {
  float position[3];  // in the world
  float z;            // along the view
  float tan_x, tan_y;
  float x, y;  // pixels
};

// False behind the near plane, and for what is not a number.
bool project_centre(const View& view, const GaussianBlock& gaussians, uint32_t lane,
                    Centre& centre) {
  const float* m = view.view_from_world;
  float seen[3];
  for (int i = 0; i < 3; ++i) centre.position[i] = gaussians.position_m[i][lane];
  for (int i = 0; i < 3; ++i) {
    seen[i] = (m[4 * i] * centre.position[0] + m[4 * i + 1] * centre.position[1]) +
              (m[4 * i + 2] * centre.position[2] + m[4 * i + 3]);
  }
  centre.z = seen[2];
  if (!(centre.z > view.near_m)) return false;
  centre.tan_x = seen[0] / centre.z;
  centre.tan_y = seen[1] / centre.z;
  centre.x = view.fx_px * centre.tan_x + view.cx_px;
  centre.y = view.fy_px * centre.tan_y + view.cy_px;
  return is_finite(centre.x) && is_finite(centre.y);
}

// The dilated covariance [[a, b], [b, c]] of a splat, in pixels.
struct Covariance {
  float a, b, c, determinant;
  float undilated;  // the determinant before the dilation, at most `determinant`
};

// False if anything of it is not finite.
bool project_covariance(const View& view, const GaussianBlock& gaussians, uint32_t lane,
                        float dilation_px2, const Centre& centre, Covariance& covariance) {
  // Rows u, v of the projected factor J R F; the 2D covariance is their Gram matrix plus the
  // dilation.
  const float* m = view.view_from_world;
  const float clamped_x = clamp(centre.tan_x, view.tan_x_min, view.tan_x_max);
  const float clamped_y = clamp(centre.tan_y, view.tan_y_min, view.tan_y_max);
  const float focal_x = view.fx_px / centre.z, focal_y = view.fy_px / centre.z;
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
  covariance.a = uu + dilation_px2;
  covariance.b = dot(u, v);
  covariance.c = vv + dilation_px2;
  // a c - b^2 would cancel for needles. By Cauchy-Binet it is the sum of the squared 2x2 minors of
  // [u; v] and of the dilation's terms: all positive.
  const float minors[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                           u[0] * v[1] - u[1] * v[0]};
  covariance.undilated = dot(minors, minors);
  covariance.determinant =
      covariance.undilated + dilation_px2 * (uu + vv) + dilation_px2 * dilation_px2;
  return is_finite(covariance.a) && is_finite(covariance.b) && is_finite(covariance.c) &&
         is_finite(covariance.determinant);
}

// Where alpha can reach the cut.
struct Bounds {
  float reach;                    // u^2 + v^2 there
  float half_width, half_height;  // pixels
  float left, right, top, bottom;
};

Bounds bound(const View& view, float opacity, const Centre& centre, const Covariance& covariance) {
  // reach = log2(opacity / cut); 2 ln(opacity / cut) = 2 ln 2 reach. What is below the cut has a
  // reach of nothing but slack.
  constexpr float kTwoLn2 = 1.38629436f;
  const float log2_ratio = log2_float(opacity / view.alpha_cut);
  Bounds bounds;
  bounds.reach = (log2_ratio > 0 ? log2_ratio : 0.0f) + kReachSlack;
  // In standard deviations; apart from a and c, so that nothing overflows.
  const float radius = __builtin_sqrtf(kTwoLn2 * bounds.reach) * kBoxSlackRatio;
  bounds.half_width = radius * __builtin_sqrtf(covariance.a) + kBoxSlackPx;
  bounds.half_height = radius * __builtin_sqrtf(covariance.c) + kBoxSlackPx;
  bounds.left = centre.x - bounds.half_width;
  bounds.right = centre.x + bounds.half_width;
  bounds.top = centre.y - bounds.half_height;
  bounds.bottom = centre.y + bounds.half_height;
  return bounds;
}

// Pixel centres lie between 0.5 and size - 0.5.
bool touches_image(const View& view, const Bounds& bounds) {
  const float width = static_cast<float>(view.width_px),
              height = static_cast<float>(view.height_px);
  return bounds.left <= width - 0.5f && bounds.right >= 0.5f && bounds.top <= height - 0.5f &&
         bounds.bottom >= 0.5f;
}

Splat make_splat(const View& view, float opacity, const float* rgb, const Centre& centre,
                 const Covariance& covariance, const Bounds& bounds) {
  constexpr float kLog2E = 1.44269504f;
  const float scale_u = __builtin_sqrtf(covariance.c / covariance.determinant * (0.5f * kLog2E));
  return {.mean_x = centre.x,
          .mean_y = centre.y,
          .slope = covariance.b / covariance.c,
          .scale_u = scale_u,
          .scale_v = __builtin_sqrtf(0.5f * kLog2E / covariance.c),
          .inverse_scale_u = 1.0f / scale_u,
          .reach = bounds.reach,
          .half_height = bounds.half_height,
          .opacity = opacity,
          .red = rgb[0],
          .green = rgb[1],
          .blue = rgb[2],
          .widest_dy_px = covariance.b / covariance.a * bounds.half_width,
          .tile_x_begin = tile_of(bounds.left, view.width_px),
          .tile_y_begin = tile_of(bounds.top, view.height_px),
          .tile_x_last = tile_of(bounds.right, view.width_px),
          .tile_y_last = tile_of(bounds.bottom, view.height_px)};
}

// What is left of the opacity where the dilation adds nothing to a Gaussian's weight in the
// picture: sqrt(det / dilated det), by sums of squares, so neither cancels and the ratio is within
// 0 and 1. A needle or disc seen edge-on, whose determinant vanishes, vanishes with it.
float antialiased(float opacity, const Covariance& covariance) {
  return opacity * __builtin_sqrtf(covariance.undilated / covariance.determinant);
}

enum class Lane : uint32_t { kVisible, kTransparent, kOutside, kBehindOrNotFinite };

Lane project_lane(const ProjectJob& job, uint32_t lane) {
  const View& view = *job.view;
  const GaussianBlock& gaussians = *job.gaussians;
  float opacity = gaussians.opacity[lane];
  if (!(opacity > 0) || !is_finite(opacity)) return Lane::kBehindOrNotFinite;
  opacity = opacity < kMaxOpacity ? opacity : kMaxOpacity;
  const auto is_left_out = [&] {
    return opacity < view.alpha_cut && (job.leave_out & kLeaveOutTransparent) != 0;
  };
  if (is_left_out()) return Lane::kTransparent;
  Centre centre;
  Covariance covariance;
  if (!project_centre(view, gaussians, lane, centre) ||
      !project_covariance(view, gaussians, lane, dilation_of(job), centre, covariance)) {
    return Lane::kBehindOrNotFinite;
  }
  if (job.antialiased != 0) opacity = antialiased(opacity, covariance);
  if (is_left_out()) return Lane::kTransparent;
  const Bounds bounds = bound(view, opacity, centre, covariance);
  if (!touches_image(view, bounds) && (job.leave_out & kLeaveOutOutside) != 0) {
    return Lane::kOutside;
  }
  float direction[3], rgb[3];
  for (int k = 0; k < 3; ++k) direction[k] = centre.position[k] - view.camera_centre_m[k];
  const float inverse_length = 1.0f / __builtin_sqrtf(dot(direction, direction));
  for (int k = 0; k < 3; ++k) direction[k] *= inverse_length;
  if (!evaluate_colour(job, lane, direction, rgb)) return Lane::kBehindOrNotFinite;
  job.splats[lane] = make_splat(view, opacity, rgb, centre, covariance, bounds);
  job.depth_m[lane] = centre.z;
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
