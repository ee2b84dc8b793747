// Rotations in double on GLM's types, with an order of operations of their own: what GLM computes
// may change with its release and its build options, and a motion must keep its bits. Rounding is
// that of the motions that were made before (Eigen's on x86-64): sums of three left to right, of
// four in pairs.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace figurine::ports {

using Quat = glm::dquat;
using Vec3 = glm::dvec3;
using Mat3 = glm::dmat3;  // columns

inline Quat no_turn() { return Quat(1, 0, 0, 0); }
inline Quat reversed(const Quat& q) { return Quat(q.w, -q.x, -q.y, -q.z); }

inline Quat negated(const Quat& q) { return Quat(-q.w, -q.x, -q.y, -q.z); }  // the same rotation

inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double dot(const Quat& a, const Quat& b) {
  return (a.x * b.x + a.z * b.z) + (a.y * b.y + a.w * b.w);
}
inline double length(const Vec3& v) { return std::sqrt(dot(v, v)); }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Of length 1; zero stays zero.
inline Vec3 unit(const Vec3& v) {
  const double square = dot(v, v);
  return square > 0 ? v / std::sqrt(square) : v;
}
inline Quat unit(const Quat& q) {
  const double square = dot(q, q);
  if (!(square > 0)) return q;
  const double norm = std::sqrt(square);
  return Quat(q.w / norm, q.x / norm, q.y / norm, q.z / norm);
}

// First b, then a.
inline Quat product(const Quat& a, const Quat& b) {
  return Quat((a.w * b.w - a.y * b.y) - (a.z * b.z + a.x * b.x),
              (a.w * b.x + a.y * b.z) - (a.z * b.y - a.x * b.w),
              (a.w * b.y + a.y * b.w) + (a.z * b.x - a.x * b.z),
              (a.w * b.z - a.y * b.x) + (a.z * b.w + a.x * b.y));
}

inline Vec3 rotated(const Quat& q, const Vec3& v) {
  const Vec3 axis(q.x, q.y, q.z);
  Vec3 twice = cross(axis, v);
  twice += twice;
  return v + q.w * twice + cross(axis, twice);
}

inline Quat about(const Vec3& axis, double angle_rad) {
  const double half = 0.5 * angle_rad, sine = std::sin(half);
  return Quat(std::cos(half), sine * axis.x, sine * axis.y, sine * axis.z);
}

// The smallest rotation that turns one direction into another; of opposite ones, about any axis
// across.
inline Quat between(const Vec3& from, const Vec3& to) {
  const Vec3 a = unit(from), b = unit(to);
  const double cosine = dot(b, a);
  if (cosine < -1 + 1e-12) {
    const Vec3 side = std::abs(a.x) < 0.9 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 axis = unit(cross(a, side));
    return Quat(0, axis.x, axis.y, axis.z);
  }
  const Vec3 axis = cross(a, b);
  const double s = std::sqrt((1 + cosine) * 2), inverse = 1 / s;
  return Quat(s * 0.5, axis.x * inverse, axis.y * inverse, axis.z * inverse);
}

inline Quat sum_of(double a, const Quat& p, double b, const Quat& q) {
  return Quat(a * p.w + b * q.w, a * p.x + b * q.x, a * p.y + b * q.y, a * p.z + b * q.z);
}

// From a (share 0) to b (share 1), along the shorter way.
inline Quat slerped(const Quat& a, double share, const Quat& b) {
  const double cosine = dot(a, b), size = std::abs(cosine);
  double of_a = 1 - share, of_b = share;
  if (size < 1 - std::numeric_limits<double>::epsilon()) {
    const double angle = std::acos(size), sine = std::sin(angle);
    of_a = std::sin((1 - share) * angle) / sine;
    of_b = std::sin(share * angle) / sine;
  }
  return sum_of(of_a, a, cosine < 0 ? -of_b : of_b, b);
}

// The angle of the rotation from one to the other, from 0 to pi.
inline double angle_between(const Quat& a, const Quat& b) {
  const Quat d = product(a, reversed(b));
  return 2 * std::atan2(length({d.x, d.y, d.z}), std::abs(d.w));
}

inline Mat3 matrix_of(const Quat& q) {
  const double tx = 2 * q.x, ty = 2 * q.y, tz = 2 * q.z, wx = tx * q.w, wy = ty * q.w,
               wz = tz * q.w, xx = tx * q.x, xy = ty * q.x, xz = tz * q.x, yy = ty * q.y,
               yz = tz * q.y, zz = tz * q.z;
  return {{1 - (yy + zz), xy + wz, xz - wy},
          {xy - wz, 1 - (xx + zz), yz + wx},
          {xz + wy, yz - wx, 1 - (xx + yy)}};
}

// Of a rotation matrix (orthonormal, right-handed). Based on: Shoemake, Quaternions, 1987.
inline Quat quaternion_of(const Mat3& m) {
  const double trace = m[0][0] + (m[1][1] + m[2][2]);
  if (trace > 0) {
    double t = std::sqrt(trace + 1);
    const double w = 0.5 * t;
    t = 0.5 / t;
    return Quat(w, (m[1][2] - m[2][1]) * t, (m[2][0] - m[0][2]) * t, (m[0][1] - m[1][0]) * t);
  }
  int i = m[1][1] > m[0][0] ? 1 : 0;
  if (m[2][2] > m[i][i]) i = 2;
  const int j = (i + 1) % 3, k = (j + 1) % 3;
  double t = std::sqrt(m[i][i] - m[j][j] - m[k][k] + 1);
  Quat q = no_turn();
  Vec3 v(0);
  v[i] = 0.5 * t;
  t = 0.5 / t;
  q.w = (m[j][k] - m[k][j]) * t;
  v[j] = (m[i][j] + m[j][i]) * t;
  v[k] = (m[i][k] + m[k][i]) * t;
  return Quat(q.w, v.x, v.y, v.z);
}

inline Vec3 product(const Mat3& m, const Vec3& v) {
  return {m[0][0] * v.x + m[1][0] * v.y + m[2][0] * v.z,
          m[0][1] * v.x + m[1][1] * v.y + m[2][1] * v.z,
          m[0][2] * v.x + (m[1][2] * v.y + m[2][2] * v.z)};
}
inline Mat3 product(const Mat3& a, const Mat3& b) {
  return {product(a, b[0]), product(a, b[1]), product(a, b[2])};
}
inline Mat3 scaled(const Mat3& m, const Vec3& s) {  // columns
  return {m[0] * s.x, m[1] * s.y, m[2] * s.z};
}

}  // namespace figurine::ports
