#include "runtime/src/pose/visibility.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/gaussian.h"
#include "runtime/src/base/float_math.h"

namespace figurine {
namespace {

// Bounds are widened by more than a thousand roundings.
constexpr float kSlackRatio = 1.001f, kSlackPx = 0.05f;

struct Interval {
  float low, high;
};

// Of x / z for x and z > 0 in intervals.
Interval divide(const Interval& x, const Interval& z) {
  return {x.low < 0 ? x.low / z.low : x.low / z.high,
          x.high > 0 ? x.high / z.low : x.high / z.high};
}

// Whether pixels centred between 0.5 and size - 0.5 may lie within reach of a mean in an interval.
// Anything not comparable may.
bool touches(const Interval& mean_px, float reach_px, uint32_t size_px) {
  return !(mean_px.low - reach_px > static_cast<float>(size_px) - 0.5f) &&
         !(mean_px.high + reach_px < 0.5f);
}

// A texel in the world.
void find_centre(const kernels::CanonicalBlock& texels, const kernels::TransformBlock& transforms,
                 uint32_t lane, float* centre) {
  for (uint32_t i = 0; i < 3; ++i) {
    centre[i] = transforms.own_translation_m[i][lane];
    for (uint32_t j = 0; j < 3; ++j)
      centre[i] += transforms.linear[3 * i + j][lane] * texels.position_m[j][lane];
  }
}

// In view coordinates.
float along(const kernels::View& view, int axis, const float* point) {
  const float* m = view.view_from_world + 4 * axis;
  return (m[0] * point[0] + m[1] * point[1]) + (m[2] * point[2] + m[3]);
}

// A texel's Gaussian lies within `radius_m` of `centre` (world) and deviates by at most
// deviation_m.
bool sphere_may_be_seen(const float* centre, float radius_m, float deviation_m, float sigmas,
                        const kernels::View& view) {
  Interval seen[3];
  for (int i = 0; i < 3; ++i) {
    const float at = along(view, i, centre);
    seen[i] = {at - radius_m, at + radius_m};
  }
  if (seen[2].high <= view.near_m) return false;  // behind the near plane, wherever it is
  if (!(seen[2].low > view.near_m)) return true;  // its projection has no bound
  const Interval tan_x = divide(seen[0], seen[2]), tan_y = divide(seen[1], seen[2]);
  // |u| <= f / z (1 + |tan|) deviation, where the tangent is clamped; a = |u|^2 + dilation.
  const float steepest_x = std::max(std::fabs(view.tan_x_min), std::fabs(view.tan_x_max)),
              steepest_y = std::max(std::fabs(view.tan_y_min), std::fabs(view.tan_y_max));
  const float scale = deviation_m / seen[2].low;
  const float dilation_px = std::sqrt(kDilationPx2);
  const auto reach = [&](float focal_px, float steepest) {
    return kSlackRatio * sigmas * (focal_px * scale * (1 + steepest) + dilation_px) + kSlackPx;
  };
  return touches({view.fx_px * tan_x.low + view.cx_px, view.fx_px * tan_x.high + view.cx_px},
                 reach(view.fx_px, steepest_x), view.width_px) &&
         touches({view.fy_px * tan_y.low + view.cy_px, view.fy_px * tan_y.high + view.cy_px},
                 reach(view.fy_px, steepest_y), view.height_px);
}

// At least the largest singular value of A, and 1 for a rotation: the largest eigenvalue of A^T A
// is at most its largest row sum of magnitudes (Gershgorin).
float largest_stretch(const float* a) {
  float largest = 0;
  for (int i = 0; i < 3; ++i) {
    float sum = 0;
    for (int j = 0; j < 3; ++j) {
      sum += std::fabs(a[i] * a[j] + a[3 + i] * a[3 + j] + a[6 + i] * a[6 + j]);
    }
    largest = std::max(largest, sum);
  }
  return std::sqrt(largest);
}

}  // namespace

GaussianBounds bounds_of(const HeadDecoding& decoding, float largest_m) {
  const float largest = decoding.offset_scale_m * decoding.max_offset * std::sqrt(3.0f);
  return {.offset_m = decoding.max_offset == 0 ? std::numeric_limits<float>::infinity() : largest,
          .extents = exp_float(decoding.max_log_scale),
          .widening_m = largest_m};  // sqrt(a^2 + s^2) <= a + s
}

bool may_be_seen(const kernels::CanonicalBlock& texels, const kernels::TransformBlock& transforms,
                 const GaussianBounds& bounds, const kernels::View& view) {
  // Standard deviations at which an opacity of 1 falls to the cut: sqrt(2 ln(1 / cut)).
  constexpr float kTwoLn2 = 1.38629436f;
  const float sigmas = std::sqrt(kTwoLn2 * log2_float(1 / view.alpha_cut) + 1e-2f);
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    float a[9], centre[3];
    for (uint32_t i = 0; i < 9; ++i) a[i] = transforms.linear[i][lane];
    find_centre(texels, transforms, lane, centre);
    const float stretch = largest_stretch(a) * kSlackRatio;
    float magnitude = 1;
    for (int i = 0; i < 3; ++i) {
      magnitude =
          std::max({magnitude, std::fabs(centre[i]), std::fabs(view.view_from_world[4 * i + 3])});
    }
    const float radius_m = stretch * bounds.offset_m + 1e-5f * magnitude;
    const float deviation_m =
        stretch * (bounds.extents * texels.extent_m[lane] + bounds.widening_m);
    // Written so that anything not comparable counts as seen.
    if (!(radius_m < std::numeric_limits<float>::max())) return true;
    if (sphere_may_be_seen(centre, radius_m, deviation_m, sigmas, view)) return true;
  }
  return false;
}

uint32_t find_averted(const kernels::TexelBlock& body, const kernels::CanonicalBlock& texels,
                      const kernels::TransformBlock& transforms, const kernels::View& view,
                      float cosine) {
  float averted[kernels::kLanes];  // > 0: by that much
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    float normal[3], sight[3];
    for (uint32_t i = 0; i < 3; ++i) {
      float centre = transforms.own_translation_m[i][lane];
      normal[i] = 0;
      for (uint32_t j = 0; j < 3; ++j) {
        centre += transforms.linear[3 * i + j][lane] * texels.position_m[j][lane];
        normal[i] += transforms.linear[3 * i + j][lane] * body.mean_normal[j][lane];
      }
      sight[i] = centre - view.camera_centre_m[i];
    }
    const float along = normal[0] * sight[0] + normal[1] * sight[1] + normal[2] * sight[2];
    const float lengths2 = (normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) *
                           (sight[0] * sight[0] + sight[1] * sight[1] + sight[2] * sight[2]);
    averted[lane] = along * std::fabs(along) - cosine * cosine * lengths2;
  }
  // Written so that anything not comparable counts as facing the camera.
  uint32_t lanes = 0;
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
    lanes |= (averted[lane] > 0 ? 1u : 0u) << lane;
  return lanes;
}

float BoxInImage::side_px() const {
  const float width = right_px - left_px, height = bottom_px - top_px;
  // Written so that anything not comparable counts as infinite.
  const float longer = width > height ? width : height;
  return longer < std::numeric_limits<float>::max() && longer >= 0
             ? longer
             : std::numeric_limits<float>::infinity();
}

void widen(const float* point, const kernels::View& view, BoxInImage& box) {
  const float z = along(view, 2, point);
  if (!(z > view.near_m)) {
    box.right_px = box.bottom_px = std::numeric_limits<float>::infinity();
    return;
  }
  const float x = view.fx_px * (along(view, 0, point) / z) + view.cx_px,
              y = view.fy_px * (along(view, 1, point) / z) + view.cy_px;
  box.left_px = std::min(box.left_px, x);
  box.right_px = std::max(box.right_px, x);
  box.top_px = std::min(box.top_px, y);
  box.bottom_px = std::max(box.bottom_px, y);
}

void widen(const kernels::CanonicalBlock& texels, const kernels::TransformBlock& transforms,
           const kernels::View& view, BoxInImage& box) {
  float centre[3];
  find_centre(texels, transforms, 0, centre);
  widen(centre, view, box);
}

}  // namespace figurine
