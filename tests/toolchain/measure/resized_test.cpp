// Pictures at another size, by hand.
#include "toolchain/measure/resized.h"

#include <gtest/gtest.h>

namespace figurine::measure::resized_test {
namespace {

// One row or column of grey values.
Picture line(const std::vector<uint8_t>& values, bool column = false) {
  const auto n = static_cast<uint32_t>(values.size());
  Picture picture{column ? 1 : n, column ? n : 1, {}};
  for (const uint8_t value : values) picture.rgba.insert(picture.rgba.end(), 4, value);
  return picture;
}

std::vector<uint8_t> values_of(const Picture& picture) {
  std::vector<uint8_t> values;
  for (size_t i = 0; i < picture.rgba.size(); i += 4) {
    for (size_t c = 1; c < 4; ++c) EXPECT_EQ(picture.rgba[i + c], picture.rgba[i]);
    values.push_back(picture.rgba[i]);
  }
  return values;
}

using Values = std::vector<uint8_t>;

TEST(Resized, AtItsOwnSizeIsThePicture) {
  const Picture picture = line({3, 200, 7, 255});
  EXPECT_EQ(resized(picture, 4, 1).rgba, picture.rgba);
}

TEST(Resized, GrowsBilinearlyBetweenPixelCentres) {
  // New centres at -1/4, 1/4, 3/4 and 5/4 of the old ones.
  EXPECT_EQ(values_of(resized(line({0, 200}), 4, 1)), (Values{0, 50, 150, 200}));
  EXPECT_EQ(values_of(resized(line({0, 200}, true), 1, 4)), (Values{0, 50, 150, 200}));
}

TEST(Resized, ShrinksToTheMeanOfWhatAPixelCovers) {
  EXPECT_EQ(values_of(resized(line({10, 20, 30, 60}), 2, 1)), (Values{15, 45}));
  // Pixels of 1.5: 10 and half of 20, half of 20 and 40.
  EXPECT_EQ(values_of(resized(line({10, 20, 40}), 2, 1)), (Values{13, 33}));
  EXPECT_EQ(values_of(resized(line({0, 255, 255, 1}, true), 1, 1)), (Values{128}));
}

TEST(Resized, KeepsChannelsApart) {
  const Picture picture{1, 2, {10, 20, 30, 255, 30, 40, 70, 1}};
  EXPECT_EQ(resized(picture, 1, 1).rgba, (Values{20, 30, 50, 128}));
}

}  // namespace
}  // namespace figurine::measure::resized_test
