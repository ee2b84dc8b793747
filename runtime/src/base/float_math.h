// exp, exp2, log2, erf and the logistic function in float, of our own, for all code that is no
// kernel: kernels include the same text (runtime/src/kernels/kernel_math.inc) under their own
// flags.
#pragma once

#include <stdint.h>

namespace figurine {

#include "runtime/src/kernels/kernel_math.inc"

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

}  // namespace figurine
