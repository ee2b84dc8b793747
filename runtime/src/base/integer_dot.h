// Dot products of int16 arrays to exact int32 sums: what the ends of a network in fixed point and a
// sampler's matrices are made of.
//
// Integer sums are exact, so any order gives the same bits; the caller says that none overflows.
// Compilers make pmaddwd (SSE2) or smlal (NEON) of the loop.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace figurine {

inline constexpr size_t kDotsAtOnce =
    4;  // sums of one pass: enough to hide the loads, few enough for 16 registers
inline constexpr size_t kDotMultiple = 8;  // lengths are multiples of it, padded by zeros

// sums[i] += shared . rows[i] for four rows that lie `length` apart. All aligned to 16 bytes.
inline void add_four_dots(const int16_t* __restrict shared, const int16_t* __restrict rows,
                          size_t length, int32_t* __restrict sums) {
  shared = std::assume_aligned<16>(shared);
  rows = std::assume_aligned<16>(rows);
  const int16_t *r0 = rows, *r1 = r0 + length, *r2 = r1 + length, *r3 = r2 + length;
  int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  for (size_t k = 0; k < length; ++k) {
    s0 += int32_t{shared[k]} * r0[k];
    s1 += int32_t{shared[k]} * r1[k];
    s2 += int32_t{shared[k]} * r2[k];
    s3 += int32_t{shared[k]} * r3[k];
  }
  sums[0] += s0;
  sums[1] += s1;
  sums[2] += s2;
  sums[3] += s3;
}

}  // namespace figurine
