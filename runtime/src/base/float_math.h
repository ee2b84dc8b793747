// exp, exp2, log2, erf and the logistic function in float, of our own: glibc picks other code by
// CPU, and the last bits with it.
//
// Every operation below is exactly rounded IEEE arithmetic in a fixed order, so each CPU and each
// vector width gives the same bits (contraction is off in the whole project). Errors are relative,
// against the exact value, the largest over all floats of the stated range (float_math_test
// measures them). The polynomial is minimax in relative error on [-1/2, 1/2] (Remez), with the
// constant term held at 1 so that exp2(0) == 1.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

namespace figurine {

// 2^f for |f| <= 1/2. Degree 6: 3e-8 of its own, below the rounding of its evaluation.
inline float exp2_fraction(float f) {
  float p = 0x1.470b4ap-13f;
  p = p * f + 0x1.5f7276p-10f;
  p = p * f + 0x1.3b270ep-7f;
  p = p * f + 0x1.c6ae72p-5f;
  p = p * f + 0x1.ebfbe2p-3f;
  p = p * f + 0x1.62e432p-1f;
  return p * f + 1.0f;
}

// x rounded to an integer, ties to even, for |x| < 2^22: adding 1.5 * 2^23 leaves no fraction bits.
inline float round_small(float x) {
  constexpr float kMagic = 12582912.0f;
  return (x + kMagic) - kMagic;
}

// 2^n for integers -126 <= n <= 127.
inline float power_of_two(float n) {
  return std::bit_cast<float>((static_cast<int32_t>(n) + 127) << 23);
}

// 2^-x for x >= 0; everything above 126 counts as 126, so that no denormal appears. Not for NaN.
// Largest error 1.1e-7.
inline float exp2_minus(float x) {
  x = x < 126.0f ? x : 126.0f;
  const float n = round_small(x);
  return exp2_fraction(n - x) * std::bit_cast<float>((127 - static_cast<int32_t>(n)) << 23);
}

// e^x for all floats: 0 below the normal range, inf above it, NaN for NaN. Largest error 1.3e-7.
inline float exp_float(float x) {
  if (!(x > -87.33f)) return x != x ? x : 0.0f;
  if (x > 88.722835f) return std::numeric_limits<float>::infinity();
  constexpr float kLog2E = 1.44269504f;
  // ln 2 in two parts, the first with trailing zeros so that n * kLn2High is exact (Cody and Waite,
  // Software Manual for the Elementary Functions, 1980).
  constexpr float kLn2High = 0x1.62e4p-1f, kLn2Low = 0x1.7f7d1cp-20f;
  float n = round_small(x * kLog2E);
  const float r = (x - n * kLn2High) - n * kLn2Low;
  // Near the top n is 128, whose power does not fit a float: half of it now, the other half at the
  // end.
  const float twice = n > 127.0f ? 2.0f : 1.0f;
  n = n > 127.0f ? 127.0f : n;
  return exp2_fraction(r * kLog2E) * power_of_two(n) * twice;
}

// 1 / (1 + e^-x): 0 for -inf, 1 for inf.
inline float logistic(float x) { return 1.0f / (1.0f + exp_float(-x)); }

// erf(x) for all finite floats, without a branch. Largest absolute error 6e-7. Abramowitz and
// Stegun, Handbook of Mathematical Functions, 1964, 7.1.26 (1.5e-7 of its own).
inline float erf_float(float x) {
  const float a = x < 0.0f ? -x : x;
  const float t = 1.0f / (1.0f + 0.3275911f * a);
  float p = 1.061405429f;
  p = p * t - 1.453152027f;
  p = p * t + 1.421413741f;
  p = p * t - 0.284496736f;
  p = p * t + 0.254829592f;
  const float tail = p * t * exp2_minus(a * a * 1.44269504f);
  return x < 0.0f ? tail - 1.0f : 1.0f - tail;
}

// log2(x) for normal x > 0. Largest absolute error 2e-7 + 1.2e-7 |log2 x|.
inline float log2_float(float x) {
  // x = 2^n m, m in [sqrt(1/2), sqrt(2)), and log(m) = 2 artanh((m - 1) / (m + 1)) as its series.
  const int32_t bits = std::bit_cast<int32_t>(x);
  constexpr int32_t kSqrtHalf = 0x3f3504f3;
  const int32_t n = (bits - kSqrtHalf) >> 23;
  const float m = std::bit_cast<float>(bits - (n << 23));
  const float s = (m - 1.0f) / (m + 1.0f), s2 = s * s;
  float p = 1.0f / 9.0f;
  p = p * s2 + 1.0f / 7.0f;
  p = p * s2 + 1.0f / 5.0f;
  p = p * s2 + 1.0f / 3.0f;
  p = p * s2 + 1.0f;
  return static_cast<float>(n) + 2.88539008f * (s * p);
}

}  // namespace figurine
