// One Gaussian through one camera and back: EWA projection, colour from spherical harmonics, and
// the analytic gradient of both.
//
// Equations and letters are those of docs/numerics.md, "Splatting": view point v, tangents (tx, ty)
// clamped in the Jacobian only, G = R F, rows u and v of the projected 2x3 factor, a = u.u + e, b =
// u.v, c = v.v + e, determinant by Cauchy-Binet. The blend's parameters are
//   power = -(P (dx - K dy)^2 + Q dy^2),   P = c / (2 det), K = b / c, Q = 1 / (2 c).
// Where splats are antialiased, opacities are multiplied by rho = sqrt(n.n / det), n = u x v.
// Based on: Zwicker et al., EWA Splatting, 2002, eq. 22-31; Yu et al., Mip-Splatting, 2024 (the 2D
// filter).
#pragma once

#include <cmath>
#include <cstdint>

#include "figurine/camera.h"
#include "figurine/gaussian.h"

namespace figurine::model {

template <class Scalar>
struct ProjectionCamera {
  Scalar rotation[9], translation[3], centre[3];  // centre: the camera's, in the world
  Scalar fx, fy, cx, cy;
  Scalar tangent_low[2], tangent_high[2];  // clamp of the Jacobian's x/z and y/z
  float depth_row[4];  // the depth key is float arithmetic in every instantiation
  float near;
  Scalar dilation;  // e, px^2

  explicit ProjectionCamera(const Camera& camera, bool antialiased = false)
      : dilation(antialiased ? kAntialiasedDilationPx2 : kDilationPx2) {
    const auto& m = camera.view_from_world;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) rotation[3 * r + k] = m[4 * r + k];
      translation[r] = m[4 * r + 3];
    }
    for (int k = 0; k < 3; ++k) {
      centre[k] = -(rotation[k] * translation[0] + rotation[3 + k] * translation[1] +
                    rotation[6 + k] * translation[2]);
    }
    for (int k = 0; k < 4; ++k) depth_row[k] = m[8 + k];
    fx = camera.fx_px, fy = camera.fy_px, cx = camera.cx_px, cy = camera.cy_px;
    const Scalar margin = Scalar(0.5) * (Scalar(kFrustumClamp) - 1), w = Scalar(camera.width_px),
                 h = Scalar(camera.height_px);
    tangent_low[0] = -(cx + margin * w) / fx, tangent_high[0] = (w - cx + margin * w) / fx;
    tangent_low[1] = -(cy + margin * h) / fy, tangent_high[1] = (h - cy + margin * h) / fy;
    near = camera.near_m;
  }
};

template <class Scalar>
struct Projected {
  float depth;            // sort key
  Scalar view[3];         // v
  Scalar tangent[2];      // clamped
  bool clamped[2];        // whether the clamp moved them
  Scalar view_factor[9];  // G
  Scalar row_x[3], row_y[3], minors[3];
  Scalar mean[2], a, b, c, determinant;
  Scalar undilated;  // n.n, the determinant before the dilation

  // What antialiasing leaves of the opacity, rho.
  Scalar compensation() const { return std::sqrt(undilated / determinant); }
};

// Real spherical harmonics of the unit direction, and optionally the derivatives by x, y, z as if
// they were independent.
template <class Scalar>
void sh_basis(uint32_t degree, Scalar x, Scalar y, Scalar z, Scalar* basis,
              Scalar (*derivative)[3]) {
  const auto set = [&](int i, Scalar value, Scalar dx, Scalar dy, Scalar dz) {
    basis[i] = value;
    if (derivative) derivative[i][0] = dx, derivative[i][1] = dy, derivative[i][2] = dz;
  };
  set(0, Scalar(kSh0), 0, 0, 0);
  if (degree < 1) return;
  const Scalar c1 = Scalar(kSh1);
  set(1, -c1 * y, 0, -c1, 0);
  set(2, c1 * z, 0, 0, c1);
  set(3, -c1 * x, -c1, 0, 0);
  if (degree < 2) return;
  const Scalar xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  const Scalar c2[5] = {Scalar(kSh2[0]), Scalar(kSh2[1]), Scalar(kSh2[2]), Scalar(kSh2[3]),
                        Scalar(kSh2[4])};
  set(4, c2[0] * xy, c2[0] * y, c2[0] * x, 0);
  set(5, c2[1] * yz, 0, c2[1] * z, c2[1] * y);
  set(6, c2[2] * (2 * zz - xx - yy), -2 * c2[2] * x, -2 * c2[2] * y, 4 * c2[2] * z);
  set(7, c2[3] * xz, c2[3] * z, 0, c2[3] * x);
  set(8, c2[4] * (xx - yy), 2 * c2[4] * x, -2 * c2[4] * y, 0);
  if (degree < 3) return;
  const Scalar c3[7] = {Scalar(kSh3[0]), Scalar(kSh3[1]), Scalar(kSh3[2]), Scalar(kSh3[3]),
                        Scalar(kSh3[4]), Scalar(kSh3[5]), Scalar(kSh3[6])};
  set(9, c3[0] * y * (3 * xx - yy), c3[0] * 6 * xy, c3[0] * 3 * (xx - yy), 0);
  set(10, c3[1] * xy * z, c3[1] * yz, c3[1] * xz, c3[1] * xy);
  set(11, c3[2] * y * (4 * zz - xx - yy), c3[2] * -2 * xy, c3[2] * (4 * zz - xx - 3 * yy),
      c3[2] * 8 * yz);
  set(12, c3[3] * z * (2 * zz - 3 * xx - 3 * yy), c3[3] * -6 * xz, c3[3] * -6 * yz,
      c3[3] * (6 * zz - 3 * xx - 3 * yy));
  set(13, c3[4] * x * (4 * zz - xx - yy), c3[4] * (4 * zz - 3 * xx - yy), c3[4] * -2 * xy,
      c3[4] * 8 * xz);
  set(14, c3[5] * z * (xx - yy), c3[5] * 2 * xz, c3[5] * -2 * yz, c3[5] * (xx - yy));
  set(15, c3[6] * x * (xx - 3 * yy), c3[6] * 3 * (xx - yy), c3[6] * -6 * xy, 0);
}

// False if the Gaussian is left out: not in front of the near plane, or something is not finite.
template <class Scalar>
bool project(const ProjectionCamera<Scalar>& camera, const Scalar* position, const Scalar* factor,
             Projected<Scalar>& out) {
  const float px = float(position[0]), py = float(position[1]), pz = float(position[2]);
  out.depth = (camera.depth_row[0] * px + camera.depth_row[1] * py) +
              (camera.depth_row[2] * pz + camera.depth_row[3]);
  if (!(out.depth > camera.near) || !std::isfinite(out.depth)) return false;
  const Scalar* R = camera.rotation;
  for (int r = 0; r < 3; ++r) {
    out.view[r] = (R[3 * r] * position[0] + R[3 * r + 1] * position[1]) +
                  (R[3 * r + 2] * position[2] + camera.translation[r]);
    for (int k = 0; k < 3; ++k) {
      out.view_factor[3 * r + k] =
          R[3 * r] * factor[k] + R[3 * r + 1] * factor[3 + k] + R[3 * r + 2] * factor[6 + k];
    }
  }
  const Scalar inverse_z = 1 / out.view[2];
  const Scalar scale[2] = {camera.fx * inverse_z, camera.fy * inverse_z};
  out.mean[0] = scale[0] * out.view[0] + camera.cx;
  out.mean[1] = scale[1] * out.view[1] + camera.cy;
  for (int i = 0; i < 2; ++i) {
    const Scalar tangent = out.view[i] * inverse_z;
    const Scalar low = camera.tangent_low[i], high = camera.tangent_high[i];
    out.tangent[i] = tangent < low ? low : tangent > high ? high : tangent;
    out.clamped[i] = !(tangent >= low && tangent <= high);
  }
  Scalar uu = 0, uv = 0, vv = 0;
  for (int k = 0; k < 3; ++k) {
    out.row_x[k] = scale[0] * (out.view_factor[k] - out.tangent[0] * out.view_factor[6 + k]);
    out.row_y[k] = scale[1] * (out.view_factor[3 + k] - out.tangent[1] * out.view_factor[6 + k]);
    uu += out.row_x[k] * out.row_x[k];
    uv += out.row_x[k] * out.row_y[k];
    vv += out.row_y[k] * out.row_y[k];
  }
  const Scalar *u = out.row_x, *v = out.row_y;
  out.minors[0] = u[1] * v[2] - u[2] * v[1];
  out.minors[1] = u[2] * v[0] - u[0] * v[2];
  out.minors[2] = u[0] * v[1] - u[1] * v[0];
  const Scalar e = camera.dilation;
  out.a = uu + e;
  out.b = uv;
  out.c = vv + e;
  out.undilated =
      out.minors[0] * out.minors[0] + out.minors[1] * out.minors[1] + out.minors[2] * out.minors[2];
  out.determinant = out.undilated + (e * (uu + vv) + e * e);
  return std::isfinite(out.determinant) && std::isfinite(out.a) && std::isfinite(out.b) &&
         std::isfinite(out.c) && std::isfinite(out.mean[0]) && std::isfinite(out.mean[1]);
}

// dL/d of mean, P, K and Q, and of ln rho (0 where splats are not antialiased).
template <class Scalar>
struct ProjectedGradient {
  Scalar mean[2], p, k, q, log_compensation;
};

// Gradient to position and factor (overwritten).
template <class Scalar>
void project_backward(const ProjectionCamera<Scalar>& camera, const Projected<Scalar>& at,
                      const ProjectedGradient<Scalar>& gradient, Scalar* position_gradient,
                      Scalar* factor_gradient) {
  const Scalar inverse_det = 1 / at.determinant, inverse_c = 1 / at.c;
  // P = c / (2 det), K = b / c, Q = 1 / (2 c)
  // ln rho = (ln n.n - ln det) / 2; whose n.n is zero is transparent and has no gradient
  const Scalar d_det = -gradient.p * at.c * Scalar(0.5) * inverse_det * inverse_det -
                       gradient.log_compensation * Scalar(0.5) * inverse_det;
  const Scalar d_undilated = gradient.log_compensation == 0
                                 ? Scalar(0)
                                 : gradient.log_compensation * Scalar(0.5) / at.undilated;
  const Scalar d_b = gradient.k * inverse_c;
  const Scalar d_c = gradient.p * Scalar(0.5) * inverse_det -
                     gradient.k * at.b * inverse_c * inverse_c -
                     gradient.q * Scalar(0.5) * inverse_c * inverse_c;
  // det = n.n + e (u.u + v.v) + e^2 with n = u x v; b = u.v; c = v.v + e
  const Scalar *u = at.row_x, *v = at.row_y, *n = at.minors;
  const Scalar e = camera.dilation;
  Scalar du[3], dv[3];
  for (int k = 0; k < 3; ++k) {
    const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    du[k] = 2 * d_det * (v[k1] * n[k2] - v[k2] * n[k1] + e * u[k]) + d_b * v[k];
    dv[k] = 2 * d_det * (n[k1] * u[k2] - n[k2] * u[k1] + e * v[k]) + d_b * u[k] + 2 * d_c * v[k];
    du[k] += 2 * d_undilated * (v[k1] * n[k2] - v[k2] * n[k1]);
    dv[k] += 2 * d_undilated * (n[k1] * u[k2] - n[k2] * u[k1]);
  }
  // u = (fx/z) (G0 - tx G2), v = (fy/z) (G1 - ty G2)
  const Scalar inverse_z = 1 / at.view[2];
  const Scalar scale[2] = {camera.fx * inverse_z, camera.fy * inverse_z};
  Scalar d_factor[9], d_tangent[2] = {0, 0}, d_view[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    d_factor[k] = scale[0] * du[k];
    d_factor[3 + k] = scale[1] * dv[k];
    d_factor[6 + k] = -(at.tangent[0] * d_factor[k] + at.tangent[1] * d_factor[3 + k]);
    d_tangent[0] -= d_factor[k] * at.view_factor[6 + k];
    d_tangent[1] -= d_factor[3 + k] * at.view_factor[6 + k];
    d_view[2] -= (du[k] * u[k] + dv[k] * v[k]) * inverse_z;
  }
  for (int i = 0; i < 2; ++i) {
    if (!at.clamped[i]) {  // t = x / z
      d_view[i] += d_tangent[i] * inverse_z;
      d_view[2] -= d_tangent[i] * at.tangent[i] * inverse_z;
    }
    // mean = f x / z + c
    d_view[i] += gradient.mean[i] * scale[i];
    d_view[2] -= gradient.mean[i] * scale[i] * at.view[i] * inverse_z;
  }
  const Scalar* R = camera.rotation;
  for (int k = 0; k < 3; ++k) {
    position_gradient[k] = R[k] * d_view[0] + R[3 + k] * d_view[1] + R[6 + k] * d_view[2];
    for (int j = 0; j < 3; ++j)
      factor_gradient[3 * k + j] =
          R[k] * d_factor[j] + R[3 + k] * d_factor[3 + j] + R[6 + k] * d_factor[6 + j];
  }
}

// colour = max(SH(direction) + 0.5, 0). False if a used coefficient is not finite.
template <class Scalar>
bool sh_colour(const ProjectionCamera<Scalar>& camera, uint32_t degree, const Scalar* position,
               const Scalar* sh, Scalar* rgb) {
  Scalar basis[16], direction[3] = {0, 0, 1};
  if (degree > 0) {
    for (int k = 0; k < 3; ++k) direction[k] = position[k] - camera.centre[k];
    const Scalar inverse = 1 / std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                                         direction[2] * direction[2]);
    for (Scalar& value : direction) value *= inverse;
  }
  sh_basis<Scalar>(degree, direction[0], direction[1], direction[2], basis, nullptr);
  Scalar sum[3] = {Scalar(kShOffset), Scalar(kShOffset), Scalar(kShOffset)};
  for (uint32_t k = 0; k < sh_coefficients(degree); ++k) {
    for (int channel = 0; channel < 3; ++channel) sum[channel] += basis[k] * sh[3 * k + channel];
  }
  for (int channel = 0; channel < 3; ++channel)
    rgb[channel] = sum[channel] > 0 ? sum[channel] : Scalar(0);
  return std::isfinite(sum[0]) && std::isfinite(sum[1]) && std::isfinite(sum[2]);
}

// Gradient to SH (overwritten) and, through the direction, to the position (added). A channel that
// was cut at 0 has no gradient.
template <class Scalar>
void sh_colour_backward(const ProjectionCamera<Scalar>& camera, uint32_t degree,
                        const Scalar* position, const Scalar* sh, const Scalar* rgb,
                        const Scalar* rgb_gradient, Scalar* sh_gradient,
                        Scalar* position_gradient) {
  Scalar basis[16], derivative[16][3], direction[3] = {0, 0, 1}, inverse = 0;
  if (degree > 0) {
    for (int k = 0; k < 3; ++k) direction[k] = position[k] - camera.centre[k];
    inverse = 1 / std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                            direction[2] * direction[2]);
    for (Scalar& value : direction) value *= inverse;
  }
  sh_basis(degree, direction[0], direction[1], direction[2], basis,
           degree > 0 ? derivative : nullptr);
  Scalar gradient[3], d_direction[3] = {0, 0, 0};
  for (int channel = 0; channel < 3; ++channel)
    gradient[channel] = rgb[channel] > 0 ? rgb_gradient[channel] : Scalar(0);
  for (uint32_t k = 0; k < sh_coefficients(degree); ++k) {
    Scalar along = 0;
    for (int channel = 0; channel < 3; ++channel) {
      sh_gradient[3 * k + channel] = basis[k] * gradient[channel];
      along += sh[3 * k + channel] * gradient[channel];
    }
    if (k > 0) {
      for (int i = 0; i < 3; ++i) d_direction[i] += derivative[k][i] * along;
    }
  }
  if (degree == 0) return;
  // direction = r / |r|: only the part across the ray moves it.
  const Scalar radial =
      d_direction[0] * direction[0] + d_direction[1] * direction[1] + d_direction[2] * direction[2];
  for (int k = 0; k < 3; ++k)
    position_gradient[k] += inverse * (d_direction[k] - radial * direction[k]);
}

}  // namespace figurine::model
