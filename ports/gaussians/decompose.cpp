// One-sided Jacobi: plane rotations from the right make the columns of F orthogonal; then F V = U
// S, the columns' lengths are the singular values and their directions the axes. Squaring the
// matrix first (eigenvectors of F F^T) would lose half of the digits: a needle of 1:1000 would come
// out with a wrong or negative small axis in float.
//
// Based on: Hestenes, Inversion of Matrices by Biorthogonalization and Related Results, 1958;
// Demmel and Veselic, Jacobi's Method is More Accurate than QR, 1992.
#include "ports/gaussians/decompose.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <utility>

namespace figurine::ports {

namespace {

// Makes two columns orthogonal; false if they already are, to rounding.
bool rotate(glm::dvec3& p, glm::dvec3& q) {
  const double alpha = glm::dot(p, p), beta = glm::dot(q, q), gamma = glm::dot(p, q);
  if (!(std::abs(gamma) > 1e-15 * std::sqrt(alpha * beta)) || alpha == 0 || beta == 0) return false;
  const double zeta = (beta - alpha) / (2 * gamma);
  const double t = (zeta >= 0 ? 1.0 : -1.0) / (std::abs(zeta) + std::hypot(1.0, zeta));
  const double c = 1 / std::sqrt(1 + t * t), s = c * t;
  const glm::dvec3 old_p = p;
  p = c * p - s * q;
  q = s * old_p + c * q;
  return true;
}

// A unit vector orthogonal to the unit vector a.
glm::dvec3 any_orthogonal(const glm::dvec3& a) {
  const glm::dvec3 axis = std::abs(a.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::normalize(glm::cross(a, axis));
}

// Of the rotation with these columns, wxyz, w not negative.
std::array<double, 4> quaternion_of(const glm::dvec3& x, const glm::dvec3& y, const glm::dvec3& z) {
  glm::dquat q = glm::normalize(glm::quat_cast(glm::dmat3(x, y, z)));
  if (q.w < 0) q = -q;
  return {q.w, q.x, q.y, q.z};
}

}  // namespace

ScaleRotation decompose(const float* factor) {
  // Scaled by the largest entry, so that squares neither overflow nor vanish.
  double largest = 0;
  for (int i = 0; i < 9; ++i) largest = std::fmax(largest, std::abs(double(factor[i])));
  if (largest == 0) return {{0, 0, 0}, {1, 0, 0, 0}};
  glm::dmat3 column;
  for (int c = 0; c < 3; ++c)
    column[c] = glm::dvec3(factor[c], factor[3 + c], factor[6 + c]) / largest;
  constexpr int kMaxSweeps = 30;  // converges quadratically; 4 to 6 sweeps in practice
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool moved = rotate(column[0], column[1]);
    moved = rotate(column[0], column[2]) || moved;
    moved = rotate(column[1], column[2]) || moved;
    if (!moved) break;
  }
  glm::dvec3 length;
  for (int c = 0; c < 3; ++c) length[c] = glm::length(column[c]);
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
  const glm::dvec3 x = column[0] / length[0];
  glm::dvec3 y = any_orthogonal(x);
  if (length[1] > 1e-12 * length[0]) {
    y = column[1] / length[1];
    y = glm::normalize(y - glm::dot(x, y) * x);
  }
  return {{length[0] * largest, length[1] * largest, length[2] * largest},
          quaternion_of(x, y, glm::cross(x, y))};
}

}  // namespace figurine::ports
