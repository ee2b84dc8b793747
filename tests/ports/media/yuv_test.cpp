// Rows of RGB in the layouts of cameras: every code where its layout puts it, equal to the code
// that figurine/ycbcr.h gives for the pixels that it stands for.
#include "ports/media/yuv.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

namespace figurine::ports::yuv_test {
namespace {

constexpr YcbcrMatrix k601 = YcbcrMatrix::kBt601, k709 = YcbcrMatrix::kBt709;

std::vector<uint8_t> random_row(size_t width, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<uint8_t> row(3 * width);
  for (uint8_t& code : row) code = static_cast<uint8_t>(random() >> 24);
  return row;
}

TEST(YuvRows, LumaIsEachPixelsOwn) {
  const std::vector<uint8_t> rgb = random_row(31, 1);
  std::vector<uint8_t> sd(31), hd(31);
  luma_row(rgb, k601, sd);
  luma_row(rgb, k709, hd);
  for (size_t x = 0; x < 31; ++x) {
    EXPECT_EQ(sd[x], luma_code<k601>(rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2])) << x;
    EXPECT_EQ(hd[x], luma_code<k709>(rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2])) << x;
  }
  EXPECT_NE(sd, hd);
}

TEST(YuvRows, ChromaIsThatOfABlocksMean) {
  for (const size_t width : {1u, 2u, 7u, 16u}) {
    const std::vector<uint8_t> top = random_row(width, 2), bottom = random_row(width, 3);
    const size_t half = (width + 1) / 2;
    std::vector<uint8_t> cb(half), cr(half), cbcr(2 * half);
    chroma_row(top, bottom, k709, cb, cr);
    interleaved_chroma_row(top, bottom, k709, cbcr);
    for (size_t x = 0; x < half; ++x) {
      const size_t left = 2 * x, right = std::min(left + 1, width - 1);
      uint32_t sum[3];
      for (size_t c = 0; c < 3; ++c)
        sum[c] = uint32_t(top[3 * left + c]) + top[3 * right + c] + bottom[3 * left + c] +
                 bottom[3 * right + c];
      const ChromaCodes codes = chroma_codes<k709, 4>(sum[0], sum[1], sum[2]);
      EXPECT_EQ(cb[x], codes.cb) << width << " " << x;
      EXPECT_EQ(cr[x], codes.cr) << width << " " << x;
      EXPECT_EQ(cbcr[2 * x], codes.cb) << width << " " << x;
      EXPECT_EQ(cbcr[2 * x + 1], codes.cr) << width << " " << x;
    }
  }
}

TEST(YuvRows, YuyvPutsPairsInTurn) {
  const std::vector<uint8_t> rgb = random_row(6, 4);
  std::vector<uint8_t> yuyv(12);
  yuyv_row(rgb, k601, yuyv);
  for (size_t pair = 0; pair < 3; ++pair) {
    const uint8_t* p = &rgb[6 * pair];
    const ChromaCodes chroma = chroma_codes<k601, 2>(p[0] + p[3], p[1] + p[4], p[2] + p[5]);
    EXPECT_EQ(yuyv[4 * pair], luma_code<k601>(p[0], p[1], p[2]));
    EXPECT_EQ(yuyv[4 * pair + 1], chroma.cb);
    EXPECT_EQ(yuyv[4 * pair + 2], luma_code<k601>(p[3], p[4], p[5]));
    EXPECT_EQ(yuyv[4 * pair + 3], chroma.cr);
  }
}

using YuvRowsDeathTest = testing::Test;
TEST(YuvRowsDeathTest, RefusesRowsOfOtherSizes) {
  const std::vector<uint8_t> odd = random_row(5, 5);
  std::vector<uint8_t> out(10);
  EXPECT_DEATH(yuyv_row(odd, k601, out), "pairs of pixels");
  EXPECT_DEATH(luma_row(odd, k601, out), "for each pixel");
}

}  // namespace
}  // namespace figurine::ports::yuv_test
