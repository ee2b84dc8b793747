// From RGB to the YCbCr codes of video and cameras, in integers: the same codes on every CPU, by
// the renderer into a camera's pixels and by the ports into files.
//
// Limited range, 8 bits. With R', G', B' in [0,1] as stored (no transfer function is applied) and
// Kg = 1 - Kr - Kb:
//   Y' = Kr R' + Kg G' + Kb B',   Cb = (B' - Y') / (2 (1 - Kb)),   Cr = (R' - Y') / (2 (1 - Kr)),
//   codes: 16 + 219 Y',   128 + 224 Cb,   128 + 224 Cr;
// each the nearest integer, halves up. The coefficients are decimal fractions, so a code is a
// quotient of integers below 2^32 and exact: no rounded coefficients, and the division is by a
// constant, which compilers turn into a multiplication.
// Based on: ITU-R BT.601-7 and BT.709-6, section 3.
#pragma once

#include <cstdint>

namespace figurine {

enum class YcbcrMatrix : uint8_t {
  kBt709,  // of HD: Kr 0.2126, Kb 0.0722
  kBt601,  // of SD: Kr 0.299, Kb 0.114
};

struct ChromaCodes {
  uint8_t cb, cr;
};

namespace ycbcr {

// Kr, Kg, Kb as parts of kOne.
template <YcbcrMatrix matrix>
inline constexpr uint32_t kOne = matrix == YcbcrMatrix::kBt601 ? 1000 : 10000;
template <YcbcrMatrix matrix>
inline constexpr uint32_t kRed = matrix == YcbcrMatrix::kBt601 ? 299 : 2126;
template <YcbcrMatrix matrix>
inline constexpr uint32_t kBlue = matrix == YcbcrMatrix::kBt601 ? 114 : 722;

// kOne x 255 Y' of an RGB code, or the sum of that over several.
template <YcbcrMatrix matrix>
constexpr uint32_t weighted(uint32_t red, uint32_t green, uint32_t blue) {
  constexpr uint32_t kGreen = kOne<matrix> - kRed<matrix> - kBlue<matrix>;
  return kRed<matrix> * red + kGreen * green + kBlue<matrix> * blue;
}

// 128 + 224 (primary - luma) / (2 (1 - K)), rounded; primary and luma are kOne x 255 count times as
// large, one_minus is kOne (1 - K). Unsigned: what wraps comes back, as the sum is positive.
constexpr uint8_t chroma_code(uint32_t primary, uint32_t luma, uint32_t one_minus, uint32_t count) {
  const uint32_t divisor = one_minus * 255 * count;
  return static_cast<uint8_t>((128 * divisor + divisor / 2 + 112 * (primary - luma)) / divisor);
}

}  // namespace ycbcr

// Y' of one pixel, 16 to 235. Codes from 0 to 255.
template <YcbcrMatrix matrix>
constexpr uint8_t luma_code(uint32_t red, uint32_t green, uint32_t blue) {
  constexpr uint32_t kDivisor = 2 * 255 * ycbcr::kOne<matrix>;
  return static_cast<uint8_t>(
      (16 * kDivisor + kDivisor / 2 + 2 * 219 * ycbcr::weighted<matrix>(red, green, blue)) /
      kDivisor);
}

// Cb and Cr of the mean of count pixels (1, 2 or 4), 16 to 240, from the sums of their codes: no
// mean is rounded on the way.
template <YcbcrMatrix matrix, uint32_t count>
constexpr ChromaCodes chroma_codes(uint32_t red, uint32_t green, uint32_t blue) {
  static_assert(count == 1 || count == 2 || count == 4);
  constexpr uint32_t kOne = ycbcr::kOne<matrix>;
  const uint32_t luma = ycbcr::weighted<matrix>(red, green, blue);
  return {ycbcr::chroma_code(kOne * blue, luma, kOne - ycbcr::kBlue<matrix>, count),
          ycbcr::chroma_code(kOne * red, luma, kOne - ycbcr::kRed<matrix>, count)};
}

}  // namespace figurine
