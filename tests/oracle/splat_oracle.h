// The brute-force truth of splatting: every Gaussian at every pixel, in double, no culling box, no
// tiles, no vectors.
//
// Written from the equations of docs/numerics.md, "Splatting", and shares no code with the
// renderers it judges; only the depth key is float arithmetic, because order is part of the
// definition (ascending float view depth, ties by index). Based on: Kerbl et al., 3D Gaussian
// Splatting for Real-Time Radiance Field Rendering, 2023; Zwicker et al., EWA Splatting, 2002.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "figurine/camera.h"
#include "figurine/gaussian.h"

namespace figurine::oracle {

// GaussianView in double; owns its arrays.
struct Gaussians {
  uint32_t count = 0;
  uint32_t sh_degree = 0;
  std::vector<double> position_m;         // [n,3]
  std::vector<double> covariance_factor;  // [n,9] row-major
  std::vector<double> opacity;            // [n]
  std::vector<double> sh;                 // [n,(d+1)^2,3]
};

inline Gaussians from_view(const GaussianView& view) {
  const auto widen = [](std::span<const float> values) {
    return std::vector<double>(values.begin(), values.end());
  };
  return {
      view.count,          view.sh_degree, widen(view.position_m), widen(view.covariance_factor),
      widen(view.opacity), widen(view.sh)};
}

// Premultiplied accumulations and what is left of the light.
struct Image {
  uint32_t width = 0, height = 0;
  std::vector<double> rgb;            // [height,width,3] premultiplied
  std::vector<double> transmittance;  // [height,width]; alpha = 1 - T
  // [height,width] 1 where a contribution came so close to a threshold (the cut, the stop) that
  // float arithmetic may decide otherwise.
  std::vector<uint8_t> doubtful;

  double alpha(size_t pixel) const { return 1 - transmittance[pixel]; }
  // Straight colour: 0 where alpha is 0.
  double straight(size_t pixel, int channel) const {
    return alpha(pixel) > 0 ? rgb[3 * pixel + channel] / alpha(pixel) : 0.0;
  }
  double over(size_t pixel, int channel, double background) const {
    return rgb[3 * pixel + channel] + transmittance[pixel] * background;
  }
};

// One Gaussian as the image sees it.
struct Splat {
  bool visible = false;
  float depth = 0;  // sort key
  double mean_px[2] = {0, 0};
  double a = 0, b = 0, c = 0;  // dilated 2D covariance [[a,b],[b,c]]
  double determinant = 0;      // by Cauchy-Binet
  double undilated = 0;        // the same before the dilation
  double opacity = 0;
  double rgb[3] = {0, 0, 0};
};

// Real spherical harmonics up to degree 3 in the direction (x,y,z), unit.
inline void sh_basis(uint32_t degree, double x, double y, double z, double* basis) {
  basis[0] = kSh0;
  if (degree < 1) return;
  basis[1] = -double(kSh1) * y;
  basis[2] = double(kSh1) * z;
  basis[3] = -double(kSh1) * x;
  if (degree < 2) return;
  basis[4] = kSh2[0] * x * y;
  basis[5] = kSh2[1] * y * z;
  basis[6] = kSh2[2] * (2 * z * z - x * x - y * y);
  basis[7] = kSh2[3] * x * z;
  basis[8] = kSh2[4] * (x * x - y * y);
  if (degree < 3) return;
  basis[9] = kSh3[0] * y * (3 * x * x - y * y);
  basis[10] = kSh3[1] * x * y * z;
  basis[11] = kSh3[2] * y * (4 * z * z - x * x - y * y);
  basis[12] = kSh3[3] * z * (2 * z * z - 3 * x * x - 3 * y * y);
  basis[13] = kSh3[4] * x * (4 * z * z - x * x - y * y);
  basis[14] = kSh3[5] * z * (x * x - y * y);
  basis[15] = kSh3[6] * x * (x * x - 3 * y * y);
}

inline Splat project(const Gaussians& gaussians, size_t i, const Camera& camera,
                     bool antialiased = false) {
  Splat splat;
  const uint32_t coefficients = sh_coefficients(gaussians.sh_degree);
  const double* p = &gaussians.position_m[3 * i];
  const double* F = &gaussians.covariance_factor[9 * i];
  const double* sh = &gaussians.sh[3 * coefficients * i];
  bool finite = std::isfinite(gaussians.opacity[i]);
  for (int k = 0; k < 3; ++k) finite = finite && std::isfinite(p[k]);
  for (int k = 0; k < 9; ++k) finite = finite && std::isfinite(F[k]);
  for (uint32_t k = 0; k < 3 * coefficients; ++k) finite = finite && std::isfinite(sh[k]);
  if (!finite) return splat;

  const auto& m = camera.view_from_world;
  const float px = static_cast<float>(p[0]), py = static_cast<float>(p[1]),
              pz = static_cast<float>(p[2]);
  volatile float left = m[8] * px, left2 = m[9] * py,
                 right = m[10] * pz;  // volatile: each product is rounded to float, no FMA
  splat.depth = (left + left2) + (right + m[11]);
  if (!(splat.depth > camera.near_m)) return splat;

  double v[3];
  for (int r = 0; r < 3; ++r)
    v[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
  const double fx = camera.fx_px, fy = camera.fy_px, cx = camera.cx_px, cy = camera.cy_px;
  splat.mean_px[0] = fx * v[0] / v[2] + cx;
  splat.mean_px[1] = fy * v[1] / v[2] + cy;

  // The Jacobian's tangents stay within the image's own range, widened by 0.15 of the side each way
  // (1.3 tan(fov/2) for a centred principal point).
  const double margin = 0.5 * (double(kFrustumClamp) - 1), w = camera.width_px,
               h = camera.height_px;
  const double tx = std::clamp(v[0] / v[2], -(cx + margin * w) / fx, (w - cx + margin * w) / fx);
  const double ty = std::clamp(v[1] / v[2], -(cy + margin * h) / fy, (h - cy + margin * h) / fy);
  double row_x[3], row_y[3];
  for (int k = 0; k < 3; ++k) {
    double g[3];
    for (int r = 0; r < 3; ++r)
      g[r] = m[4 * r] * F[k] + m[4 * r + 1] * F[3 + k] + m[4 * r + 2] * F[6 + k];
    row_x[k] = fx / v[2] * (g[0] - tx * g[2]);
    row_y[k] = fy / v[2] * (g[1] - ty * g[2]);
  }
  const double e = antialiased ? kAntialiasedDilationPx2 : kDilationPx2;
  const double xx = row_x[0] * row_x[0] + row_x[1] * row_x[1] + row_x[2] * row_x[2];
  const double yy = row_y[0] * row_y[0] + row_y[1] * row_y[1] + row_y[2] * row_y[2];
  const double minors[3] = {row_x[1] * row_y[2] - row_x[2] * row_y[1],
                            row_x[2] * row_y[0] - row_x[0] * row_y[2],
                            row_x[0] * row_y[1] - row_x[1] * row_y[0]};
  splat.a = xx + e;
  splat.b = row_x[0] * row_y[0] + row_x[1] * row_y[1] + row_x[2] * row_y[2];
  splat.c = yy + e;
  splat.undilated = minors[0] * minors[0] + minors[1] * minors[1] + minors[2] * minors[2];
  splat.determinant = splat.undilated + e * (xx + yy) + e * e;
  if (!std::isfinite(splat.determinant) || !std::isfinite(splat.mean_px[0]) ||
      !std::isfinite(splat.mean_px[1]))
    return splat;

  double direction[3], length2 = 0;
  for (int k = 0; k < 3; ++k) {
    direction[k] = p[k];
    for (int r = 0; r < 3; ++r)
      direction[k] += double(m[4 * r + k]) * m[4 * r + 3];  // camera centre = -R^T t
    length2 += direction[k] * direction[k];
  }
  double basis[16];
  const double length = std::sqrt(length2);
  sh_basis(gaussians.sh_degree, direction[0] / length, direction[1] / length, direction[2] / length,
           basis);
  for (int channel = 0; channel < 3; ++channel) {
    double value = kShOffset;
    for (uint32_t k = 0; k < coefficients; ++k) value += basis[k] * sh[3 * k + channel];
    splat.rgb[channel] = std::max(value, 0.0);
  }
  splat.opacity = gaussians.opacity[i];
  splat.visible = true;
  return splat;
}

// exp(power) of a splat at offset (dx,dy) from its mean, and power itself.
inline double power_at(const Splat& splat, double dx, double dy) {
  return -0.5 * (splat.c * dx * dx - 2 * splat.b * dx * dy + splat.a * dy * dy) / splat.determinant;
}

struct Options {
  double alpha_cut = kAlphaCut;
  bool antialiased = false;     // another dilation, opacity sqrt(det / dilated det)
  double doubt = 1e-3;          // relative distance to a threshold within which a pixel is doubtful
  bool skip_far_pixels = true;  // leave out pixels outside the ellipse of the alpha cut (they fail
                                // it): only saves time
};

inline Image render(const Gaussians& gaussians, const Camera& camera, const Options& options = {}) {
  std::vector<Splat> splats;
  for (size_t i = 0; i < gaussians.count; ++i) {
    Splat splat = project(gaussians, i, camera, options.antialiased);
    if (options.antialiased) splat.opacity *= std::sqrt(splat.undilated / splat.determinant);
    if (splat.visible) splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const Splat& a, const Splat& b) { return a.depth < b.depth; });

  const size_t pixels = size_t(camera.width_px) * camera.height_px;
  Image image{camera.width_px, camera.height_px, std::vector<double>(3 * pixels, 0.0),
              std::vector<double>(pixels, 1.0), std::vector<uint8_t>(pixels, 0)};
  std::vector<uint8_t> stopped(pixels, 0);
  for (const Splat& splat : splats) {
    if (!(splat.opacity >= options.alpha_cut)) continue;
    const auto pixel = [](double value, int64_t limit) {
      return static_cast<int64_t>(std::clamp(value, 0.0, static_cast<double>(limit)));
    };
    // The square of the ellipse where alpha = cut (or would, were it as much less as is in doubt).
    const double reach = 2 * std::log(splat.opacity / options.alpha_cut) + 4 * options.doubt;
    int64_t y0 = 0, y1 = camera.height_px;
    if (options.skip_far_pixels) {  // generous: two pixels and 1 % beyond
      const double ry = 1.01 * std::sqrt(reach * splat.c) + 2;
      y0 = pixel(splat.mean_px[1] - ry, y1), y1 = pixel(splat.mean_px[1] + ry + 1, y1);
    }
    for (int64_t y = y0; y < y1; ++y) {
      int64_t x0 = 0, x1 = camera.width_px;
      if (options.skip_far_pixels) {  // c dx^2 - 2 b dx dy + a dy^2 = reach det, solved for dx
        const double dy = y + 0.5 - splat.mean_px[1], middle = splat.b * dy / splat.c,
                     within = std::max(reach - dy * dy / splat.c, 0.0),
                     rx = 1.01 * std::sqrt(within * splat.determinant / splat.c) + 2;
        x0 = pixel(splat.mean_px[0] + middle - rx, x1);
        x1 = pixel(splat.mean_px[0] + middle + rx + 1, x1);
      }
      for (int64_t x = x0; x < x1; ++x) {
        const size_t at = static_cast<size_t>(y) * camera.width_px + static_cast<size_t>(x);
        if (stopped[at]) continue;
        const double power =
            power_at(splat, x + 0.5 - splat.mean_px[0], y + 0.5 - splat.mean_px[1]);
        if (power > 0) continue;
        const double alpha = std::min(double(kAlphaMax), splat.opacity * std::exp(power));
        const auto doubt = [&](double value, double threshold) {
          if (std::abs(value - threshold) < options.doubt * threshold) image.doubtful[at] = 1;
        };
        doubt(alpha, options.alpha_cut);
        if (alpha < options.alpha_cut) continue;
        const double next = image.transmittance[at] * (1 - alpha);
        doubt(next, kTransmittanceStop);
        if (next < kTransmittanceStop) {
          stopped[at] = 1;
          continue;
        }
        for (int channel = 0; channel < 3; ++channel) {
          image.rgb[3 * at + channel] += image.transmittance[at] * alpha * splat.rgb[channel];
        }
        image.transmittance[at] = next;
      }
    }
  }
  return image;
}

// PSNR for values whose peak is 1; infinity for no error.
inline double psnr_db(double squared_error, size_t values) {
  return squared_error > 0 ? -10 * std::log10(squared_error / static_cast<double>(values))
                           : std::numeric_limits<double>::infinity();
}

// PSNR over the pixels whose true alpha exceeds 0.5, both images over mid-grey. premultiplied:
// [height,width,4] R, G, B, alpha of the image to judge.
template <class Scalar>
double foreground_psnr_db(const Image& truth, std::span<const Scalar> premultiplied,
                          double background = 0.5) {
  double squared_error = 0;
  size_t values = 0;
  for (size_t pixel = 0; pixel < truth.transmittance.size(); ++pixel) {
    if (!(truth.alpha(pixel) > 0.5)) continue;
    const Scalar* value = &premultiplied[4 * pixel];
    for (int channel = 0; channel < 3; ++channel) {
      const double difference = value[channel] + (1 - double(value[3])) * background -
                                truth.over(pixel, channel, background);
      squared_error += difference * difference;
    }
    values += 3;
  }
  return psnr_db(squared_error, values);
}

}  // namespace figurine::oracle
