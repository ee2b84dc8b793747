// One-sided Jacobi: plane rotations from the right make the columns of F orthogonal; then F V = U
// S, the columns' lengths are the singular values and their directions the axes. Squaring the
// matrix first (eigenvectors of F F^T) would lose half of the digits: a needle of 1:1000 would come
// out with a wrong or negative small axis in float.
//
// Based on: Hestenes, Inversion of Matrices by Biorthogonalization and Related Results, 1958;
// Demmel and Veselic, Jacobi's Method is More Accurate than QR, 1992. Quaternion from a rotation
// matrix: Shepperd, Quaternion from Rotation Matrix, 1978.
#include "samples/gaussians/decompose.h"

#include <cmath>
#include <utility>

namespace figurine::samples {

namespace {

using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector scaled(const Vector& a, double factor) {
  return {a[0] * factor, a[1] * factor, a[2] * factor};
}

// Makes two columns orthogonal; false if they already are, to rounding.
bool rotate(Vector& p, Vector& q) {
  const double alpha = dot(p, p), beta = dot(q, q), gamma = dot(p, q);
  if (!(std::abs(gamma) > 1e-15 * std::sqrt(alpha * beta)) || alpha == 0 || beta == 0) return false;
  const double zeta = (beta - alpha) / (2 * gamma);
  const double t = (zeta >= 0 ? 1.0 : -1.0) / (std::abs(zeta) + std::hypot(1.0, zeta));
  const double c = 1 / std::sqrt(1 + t * t), s = c * t;
  for (int k = 0; k < 3; ++k) {
    const double a = p[k], b = q[k];
    p[k] = c * a - s * b;
    q[k] = s * a + c * b;
  }
  return true;
}

// A unit vector orthogonal to the unit vector a.
Vector any_orthogonal(const Vector& a) {
  const Vector axis = std::abs(a[0]) < 0.6 ? Vector{1, 0, 0} : Vector{0, 1, 0};
  const Vector result = cross(a, axis);
  return scaled(result, 1 / std::sqrt(dot(result, result)));
}

// Columns x, y, z of a rotation.
std::array<double, 4> quaternion_of(const Vector& x, const Vector& y, const Vector& z) {
  const double trace = x[0] + y[1] + z[2];
  std::array<double, 4> q;
  // The largest of the four components is found first and divides the others, so no digit cancels.
  if (trace >= x[0] && trace >= y[1] && trace >= z[2]) {
    q = {1 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]};
  } else if (x[0] >= y[1] && x[0] >= z[2]) {
    q = {y[2] - z[1], 1 + x[0] - y[1] - z[2], x[1] + y[0], x[2] + z[0]};
  } else if (y[1] >= z[2]) {
    q = {z[0] - x[2], x[1] + y[0], 1 + y[1] - x[0] - z[2], y[2] + z[1]};
  } else {
    q = {x[1] - y[0], x[2] + z[0], y[2] + z[1], 1 + z[2] - x[0] - y[1]};
  }
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double factor = (q[0] < 0 ? -1 : 1) / length;
  for (double& value : q) value *= factor;
  return q;
}

}  // namespace

ScaleRotation decompose(const float* factor) {
  // Scaled by the largest entry, so that squares neither overflow nor vanish.
  double largest = 0;
  for (int i = 0; i < 9; ++i) largest = std::fmax(largest, std::abs(double(factor[i])));
  if (largest == 0) return {{0, 0, 0}, {1, 0, 0, 0}};
  std::array<Vector, 3> column;
  for (int c = 0; c < 3; ++c)
    column[c] = {factor[c] / largest, factor[3 + c] / largest, factor[6 + c] / largest};
  constexpr int kMaxSweeps = 30;  // converges quadratically; 4 to 6 sweeps in practice
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool moved = rotate(column[0], column[1]);
    moved = rotate(column[0], column[2]) || moved;
    moved = rotate(column[1], column[2]) || moved;
    if (!moved) break;
  }
  Vector length;
  for (int c = 0; c < 3; ++c) length[c] = std::sqrt(dot(column[c], column[c]));
  const auto order = [&](int a, int b) {
    if (length[a] < length[b]) {
      std::swap(length[a], length[b]);
      std::swap(column[a], column[b]);
    }
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  // Axes of vanished lengths are free; the third always follows from the first two, which also
  // makes the rotation proper.
  const Vector x = scaled(column[0], 1 / length[0]);
  Vector y = any_orthogonal(x);
  if (length[1] > 1e-12 * length[0]) {
    y = scaled(column[1], 1 / length[1]);
    const double slip = dot(x, y);
    for (int k = 0; k < 3; ++k) y[k] -= slip * x[k];
    y = scaled(y, 1 / std::sqrt(dot(y, y)));
  }
  return {{length[0] * largest, length[1] * largest, length[2] * largest},
          quaternion_of(x, y, cross(x, y))};
}

}  // namespace figurine::samples
