#include "toolchain/capture/texture.h"

#include <cmath>

#include "gtest/gtest.h"

namespace figurine::capture::texture_test {
namespace {

TEST(Texture, SrgbEncodingIsTheInverseOfDecoding) {
  for (int i = 0; i < 256; ++i)
    EXPECT_NEAR(255 * srgb_from_linear(linear_from_srgb(static_cast<float>(i) / 255)), i, 1e-3);
}

TEST(Texture, TexelCentresReturnTheFilesValues) {
  ports::ImageU8 image(4, 2, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(10 * i);
  const Texture texture(image, TextureEncoding::kColour);
  for (uint32_t y = 0; y < 2; ++y) {
    for (uint32_t x = 0; x < 4; ++x) {
      const Rgba texel =
          texture.sample((static_cast<float>(x) + 0.5f) / 4, (static_cast<float>(y) + 0.5f) / 2, 0);
      EXPECT_NEAR(texel.colour.y, linear_from_srgb(image.at(x, y)[1] / 255.0f), 1e-6);
      EXPECT_EQ(texel.alpha, 1.0f);
    }
  }
}

// What colour lies under alpha 0 must not matter.
TEST(Texture, HiddenColourDoesNotBleedIntoEdges) {
  ports::ImageU8 image(2, 1, 4);
  image.pixels = {255, 0, 255, 0, 0, 255, 0, 255};
  const Rgba half = Texture(image, TextureEncoding::kColour).sample(0.5f, 0.5f, 0);
  EXPECT_FLOAT_EQ(half.alpha, 0.5f);
  EXPECT_FLOAT_EQ(half.colour.x, 0.0f);
  EXPECT_FLOAT_EQ(half.colour.y, 0.5f);
}

TEST(Texture, CoarsestLevelIsTheMean) {
  ports::ImageU8 image(8, 8, 1);
  double mean = 0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = static_cast<uint8_t>((i * 37) % 256);
    mean += linear_from_srgb(image.pixels[i] / 255.0f) / 64;
  }
  EXPECT_NEAR(Texture(image, TextureEncoding::kColour).sample(0.3f, 0.9f, 20).colour.x, mean, 1e-6);
}

TEST(Texture, CloneCoversARegionWithItsNeighbour) {
  ports::ImageU8 image(64, 64, 3);
  for (uint32_t y = 0; y < 64; ++y) {
    for (uint32_t x = 0; x < 64; ++x) image.at(x, y)[0] = y < 32 ? 200 : 50;
  }
  clone_region(image, {0.25f, 0.1f, 0.75f, 0.4f}, {0, 0.5f});
  EXPECT_EQ(image.at(32, 16)[0], 50) << "the emblem is gone";
  EXPECT_EQ(image.at(2, 16)[0], 200) << "outside nothing changes";
  EXPECT_EQ(image.at(32, 60)[0], 50) << "nor at the source";
}

TEST(Texture, DyeTurnsHuesAndLeavesGreyAlone) {
  ports::ImageU8 image(2, 1, 3);
  image.pixels = {200, 50, 50, 90, 90, 90};
  recolour_region(image, {}, 2.0943951f, 1, 1);  // a third of the circle: red becomes green
  EXPECT_NEAR(image.at(0, 0)[0], 50, 1);
  EXPECT_NEAR(image.at(0, 0)[1], 200, 1);
  EXPECT_NEAR(image.at(0, 0)[2], 50, 1);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(image.at(1, 0)[c], 90);
}

TEST(Texture, DyedClothHasTheDyesColourAndItsOwnLightAndDark) {
  ports::ImageU8 image(3, 1, 3);
  image.pixels = {100, 100, 100, 50, 50, 50, 30, 60, 160};
  dye_region(image, image, {},
             {.fibre = Fibre::kNeutral, .dye = {0.8f, 0.4f, 0.2f}, .reference = 100 / 255.0f});
  EXPECT_NEAR(image.at(0, 0)[0], 204, 1);
  EXPECT_NEAR(image.at(0, 0)[1], 102, 1);
  EXPECT_NEAR(image.at(0, 0)[2], 51, 1);
  EXPECT_NEAR(image.at(1, 0)[0], 102, 1) << "half as light";
  EXPECT_EQ(image.at(2, 0)[2], 160) << "blue does not take a dye for grey cloth";
  dye_region(image, image, {}, {.dye = {1, 1, 1}, .amount = 0});
  EXPECT_EQ(image.at(2, 0)[2], 160) << "no amount, no change";
}

}  // namespace
}  // namespace figurine::capture::texture_test
