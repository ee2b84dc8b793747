// A picture that covers another size: the middle of it, without a seam, a mean where it shrinks.
#include "ports/media/cover.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::ports::cover_test {
namespace {

ImageU8 covered(const ImageU8& picture, uint32_t width, uint32_t height) {
  ImageU8 result(width, height, 3);
  std::fill(result.pixels.begin(), result.pixels.end(), uint8_t{99});
  CoverScaler().scale(picture, result);
  return result;
}

// Red grows to the right, green downwards.
ImageU8 ramp(uint32_t width, uint32_t height, int step = 4) {
  ImageU8 image(width, height, 3);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      image.at(x, y)[0] = static_cast<uint8_t>(step * static_cast<int>(x));
      image.at(x, y)[1] = static_cast<uint8_t>(step * static_cast<int>(y));
      image.at(x, y)[2] = 200;
    }
  }
  return image;
}

TEST(CoverScaler, TheSameSizeIsTheSamePicture) {
  const ImageU8 picture = ramp(13, 7);
  EXPECT_EQ(covered(picture, 13, 7).pixels, picture.pixels);
}

TEST(CoverScaler, CutsWhatDoesNotFitOnBothSides) {
  // 40 x 10 onto 10 x 10: columns 15 to 24.
  const ImageU8 wide = covered(ramp(40, 10), 10, 10);
  for (uint32_t y = 0; y < 10; ++y) {
    for (uint32_t x = 0; x < 10; ++x) {
      EXPECT_EQ(wide.at(x, y)[0], 4 * (15 + x));
      EXPECT_EQ(wide.at(x, y)[1], 4 * y);
      EXPECT_EQ(wide.at(x, y)[2], 200);
    }
  }
  const ImageU8 high = covered(ramp(10, 40), 10, 10);
  EXPECT_EQ(high.at(0, 0)[1], 4 * 15);
  EXPECT_EQ(high.at(0, 9)[1], 4 * 24);
}

// A line stays a line, by any factor, away from the borders; flat stays flat everywhere.
TEST(CoverScaler, ScalesALineToALine) {
  for (const uint32_t to : {96u, 64u, 48u, 33u, 20u}) {
    const ImageU8 image = covered(ramp(48, 48), to, to);
    const double step = 48.0 / to;
    const auto border = static_cast<uint32_t>(std::ceil(1 / step + 1));
    for (uint32_t x = border; x + border < to; ++x) {
      const double wanted = 4 * ((x + 0.5) * step - 0.5);
      EXPECT_NEAR(image.at(x, to / 2)[0], wanted, 0.51 + 0.05 * step) << to << " " << x;
      EXPECT_EQ(image.at(x, to / 2)[2], 200) << to;
    }
    EXPECT_EQ(image.at(0, 0)[2], 200) << to;
    EXPECT_EQ(image.at(to - 1, to - 1)[2], 200) << to;
  }
}

TEST(CoverScaler, FineStripesBecomeGrey) {
  ImageU8 stripes(64, 64, 3);
  for (size_t i = 0; i < stripes.pixels.size(); ++i) stripes.pixels[i] = i / 3 % 2 == 0 ? 0 : 255;
  const ImageU8 small = covered(stripes, 16, 16);
  for (uint32_t x = 1; x < 15; ++x) EXPECT_NEAR(small.at(x, 8)[0], 128, 2);
}

TEST(CoverScaler, OneScalerTakesAnySizes) {
  CoverScaler scaler;
  for (const auto& [from, to] : {std::pair(1u, 5u), std::pair(7u, 1u), std::pair(1u, 1u),
                                 std::pair(300u, 2u), std::pair(2u, 31u)}) {
    ImageU8 result(to, 3, 3);
    scaler.scale(ramp(from, 2, 0), result);
    for (uint32_t x = 0; x < to; ++x) EXPECT_EQ(result.at(x, 1)[2], 200) << from << " " << to;
  }
}

}  // namespace
}  // namespace figurine::ports::cover_test
