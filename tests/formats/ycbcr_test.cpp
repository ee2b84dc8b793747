// Every code is the integer nearest to what the standards' equations say, halves up: held against
// them in 64-bit integers, for all colours.
#include "figurine/ycbcr.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace figurine::ycbcr_test {
namespace {

// Kr, Kg and Kb in ten-thousandths.
struct Weights {
  int64_t red, green, blue;
};
template <YcbcrMatrix matrix>
constexpr Weights kWeights =
    matrix == YcbcrMatrix::kBt601 ? Weights{2990, 5870, 1140} : Weights{2126, 7152, 722};

// code = nearest(offset + numerator / denominator), halves up.
bool is_nearest(int64_t code, int64_t offset, int64_t numerator, int64_t denominator) {
  const int64_t twice = 2 * (code - offset) * denominator;
  return twice - denominator <= 2 * numerator && 2 * numerator < twice + denominator;
}

template <YcbcrMatrix matrix>
bool luma_is_nearest(uint32_t r, uint32_t g, uint32_t b) {
  constexpr Weights k = kWeights<matrix>;
  return is_nearest(luma_code<matrix>(r, g, b), 16, 219 * (k.red * r + k.green * g + k.blue * b),
                    255 * 10000);
}

template <YcbcrMatrix matrix, uint32_t count>
bool chroma_is_nearest(uint32_t r, uint32_t g, uint32_t b) {
  constexpr Weights k = kWeights<matrix>;
  const int64_t luma = k.red * r + k.green * g + k.blue * b;
  const ChromaCodes codes = chroma_codes<matrix, count>(r, g, b);
  return is_nearest(codes.cb, 128, 224 * (int64_t(10000) * b - luma),
                    2 * (10000 - k.blue) * 255 * count) &&
         is_nearest(codes.cr, 128, 224 * (int64_t(10000) * r - luma),
                    2 * (10000 - k.red) * 255 * count);
}

// The number of colours that judge refuses, over all sums of count codes in steps of step.
template <class Judge>
uint64_t refused(uint32_t count, uint32_t step, const Judge& judge) {
  uint64_t wrong = 0;
  for (uint32_t r = 0; r <= 255 * count; r += step) {
    for (uint32_t g = 0; g <= 255 * count; g += step) {
      for (uint32_t b = 0; b <= 255 * count; b += step) wrong += judge(r, g, b) ? 0 : 1;
    }
  }
  return wrong;
}

TEST(Ycbcr, EveryColourHasTheNearestLuma) {
  EXPECT_EQ(refused(1, 1, luma_is_nearest<YcbcrMatrix::kBt601>), 0u);
  EXPECT_EQ(refused(1, 1, luma_is_nearest<YcbcrMatrix::kBt709>), 0u);
}

TEST(Ycbcr, EveryMeanHasTheNearestChroma) {
  EXPECT_EQ(refused(1, 3, chroma_is_nearest<YcbcrMatrix::kBt601, 1>), 0u);
  EXPECT_EQ(refused(1, 3, chroma_is_nearest<YcbcrMatrix::kBt709, 1>), 0u);
  EXPECT_EQ(refused(2, 5, chroma_is_nearest<YcbcrMatrix::kBt601, 2>), 0u);
  EXPECT_EQ(refused(2, 5, chroma_is_nearest<YcbcrMatrix::kBt709, 2>), 0u);
  EXPECT_EQ(refused(4, 10, chroma_is_nearest<YcbcrMatrix::kBt601, 4>), 0u);
  EXPECT_EQ(refused(4, 10, chroma_is_nearest<YcbcrMatrix::kBt709, 4>), 0u);
}

TEST(Ycbcr, HalvesGoUp) {  // 16 + 219 (299 x 123 + 587 x 251 + 114 x 249) / 255000 = 198.5
  EXPECT_EQ(luma_code<YcbcrMatrix::kBt601>(123, 251, 249), 199);
}

TEST(Ycbcr, GreysHaveNoColour) {
  for (uint32_t grey = 0; grey < 256; ++grey) {
    const ChromaCodes one = chroma_codes<YcbcrMatrix::kBt709, 1>(grey, grey, grey),
                      four = chroma_codes<YcbcrMatrix::kBt601, 4>(4 * grey, 4 * grey, 4 * grey);
    EXPECT_EQ(one.cb, 128);
    EXPECT_EQ(one.cr, 128);
    EXPECT_EQ(four.cb, 128);
    EXPECT_EQ(four.cr, 128);
  }
}

}  // namespace
}  // namespace figurine::ycbcr_test
