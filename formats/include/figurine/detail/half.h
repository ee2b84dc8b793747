// 16-bit floats (IEEE 754 binary16) as packages store them: a storage format alone, all arithmetic
// is in float. No hardware conversions, so that every CPU reads the same floats.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace figurine {

struct Half {
  uint16_t bits = 0;
};

inline bool is_finite(Half half) { return (half.bits & 0x7C00) != 0x7C00; }

// Exact. A half that is not finite stays so.
inline float to_float(Half half) {
  const uint32_t sign = (half.bits & 0x8000u) << 16, exponent = half.bits >> 10 & 31u,
                 mantissa = half.bits & 0x3FFu;
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7F800000u | mantissa << 13);
  if (exponent == 0)
    return std::bit_cast<float>(sign |
                                std::bit_cast<uint32_t>(static_cast<float>(mantissa) * 0x1p-24f));
  return std::bit_cast<float>(sign | (exponent + 112) << 23 | mantissa << 13);
}

// To nearest, ties to even; beyond 65504 to infinity.
inline Half to_half(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value), sign = bits >> 16 & 0x8000u,
                 magnitude = bits & 0x7FFFFFFFu;
  if (magnitude >= 0x7F800000u)
    return {static_cast<uint16_t>(sign | 0x7C00u | (magnitude > 0x7F800000u ? 0x200u : 0u))};
  if (magnitude < 0x38800000u) {  // below 2^-14: adding 0.5 leaves a multiple of 2^-24 in the last
                                  // bits of the mantissa
    return {static_cast<uint16_t>(
        sign | (std::bit_cast<uint32_t>(std::bit_cast<float>(magnitude) + 0.5f) & 0x7FFu))};
  }
  const uint32_t rounded = magnitude + 0xFFFu + (magnitude >> 13 & 1u);
  return {static_cast<uint16_t>(
      sign | (rounded >= 0x47800000u ? 0x7C00u : (rounded >> 13) - (112u << 10)))};
}

}  // namespace figurine
