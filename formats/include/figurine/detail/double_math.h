// exp, expm1, log, sine, cosine and angles in double, of our own: what places noise levels, draws
// noise and Fourier channels, turns cameras and measures poses gives the same bits on every CPU.
//
// Exactly rounded IEEE operations in a fixed order, as the runtime's float_math.h. Plain power
// series, cut where the next term is below half a bit: a level or a random number is worth a few
// more multiplications, and no constant has to be believed. Errors are the largest that
// double_math_test finds against libm, over dense samples of the stated range.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace figurine {

namespace double_math {

// ln 2 in two parts, the first with 32 significant bits so that n * kLn2High is exact (Cody and
// Waite, Software Manual for the Elementary Functions, 1980).
inline constexpr double kLn2High = 0x1.62e42feep-1, kLn2Low = 0x1.a39ef35793c76p-33;
inline constexpr double kLog2E = 0x1.71547652b82fep+0, kHalfPi = 0x1.921fb54442d18p+0;

// x rounded to an integer, ties to even, for |x| < 2^51.
inline double round_small(double x) {
  constexpr double kMagic = 6755399441055744.0;  // 1.5 * 2^52 leaves no fraction bits
  return (x + kMagic) - kMagic;
}

// 2^n for integers -1022 <= n <= 1023.
inline double power_of_two(int64_t n) { return std::bit_cast<double>((n + 1023) << 52); }

// e^r - 1 for |r| <= 0.35: r + r^2/2! + ... + r^14/14!.
inline double expm1_fraction(double r) {
  double p = 1.0 / 14;
  for (int k = 13; k >= 2; --k) p = (1.0 + r * p) / k;
  return r + r * (r * p);
}

}  // namespace double_math

// e^x for all doubles: 0 below the normal range, inf above it, NaN for NaN. Largest relative error
// 2e-16.
inline double exp_double(double x) {
  using namespace double_math;
  if (!(x > -708.0)) return x != x ? x : 0.0;
  if (x > 709.782712893384) return std::numeric_limits<double>::infinity();
  const double n = round_small(x * kLog2E);
  const double r = (x - n * kLn2High) - n * kLn2Low;
  // Near the top n is 1024, whose power does not fit: in two halves.
  const int64_t whole = static_cast<int64_t>(n), half = whole / 2;
  return (1.0 + expm1_fraction(r)) * power_of_two(half) * power_of_two(whole - half);
}

// e^x - 1 without cancellation: -1 for -inf, inf for inf. Largest relative error 5e-16.
inline double expm1_double(double x) {
  if (x > -0.35 && x < 0.35) return double_math::expm1_fraction(x);
  return exp_double(x) - 1.0;
}

// ln x for normal x > 0. Largest relative error 2e-16.
inline double log_double(double x) {
  using namespace double_math;
  // x = 2^n m, m in [sqrt(1/2), sqrt(2)), and ln m = 2 artanh((m - 1) / (m + 1)) = 2 (s + s^3/3 +
  // ... + s^23/23).
  const int64_t bits = std::bit_cast<int64_t>(x);
  constexpr int64_t kSqrtHalf = 0x3fe6a09e667f3bcd;
  const int64_t n = (bits - kSqrtHalf) >> 52;
  const double f = std::bit_cast<double>(bits - (n << 52)) - 1.0;
  const double s = f / (2.0 + f), s2 = s * s;
  double p = 0;
  for (int k = 23; k >= 3; k -= 2) p = (p + 1.0 / k) * s2;
  // 2 s (1 + p) with 2 s = f - s f: f is exact, and most of the result near 1.
  const double rest = s * (2.0 * p - f) + static_cast<double>(n) * kLn2Low;
  return static_cast<double>(n) * kLn2High + (f + rest);
}

// The angle in radians, 0 to pi/2, of a sine and a cosine of one length, neither negative, not both
// zero. Largest relative error 8e-16.
inline double angle_of(double sine, double cosine) {
  // tan(a / 2) = s / (1 + c) twice over, then the series of the arcus tangent: t <= tan(pi / 16).
  double t = sine / (std::sqrt(sine * sine + cosine * cosine) + cosine);
  for (int halving = 0; halving < 2; ++halving) t = t / (1.0 + std::sqrt(1.0 + t * t));
  const double t2 = t * t;
  double p = 0;
  for (int k = 25; k >= 3; k -= 2) p = (1.0 / k - p) * t2;
  return 8.0 * (t - t * p);
}

struct SineCosine {
  double sine, cosine;
};

// Of an angle in turns, 0 <= turns <= 1. Largest absolute error 2e-16.
inline SineCosine sine_cosine_of_turns(double turns) {
  using namespace double_math;
  const double quarter = round_small(turns * 4.0);
  const double a = (turns * 4.0 - quarter) * kHalfPi,
               a2 = a * a;  // |a| <= pi/4; the difference is exact
  double s = 0, c = 0;
  for (int k = 17; k >= 3; k -= 2) s = (1.0 + s) * (-a2 / (k * (k - 1)));
  for (int k = 18; k >= 2; k -= 2) c = (1.0 + c) * (-a2 / (k * (k - 1)));
  s = a + a * s;
  c = 1.0 + c;
  switch (static_cast<int>(quarter) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

}  // namespace figurine
