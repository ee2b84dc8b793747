// Pictures as people have them (tests/data/pictures, made by make.py there): read rightly, or
// refused with a word.
#include <gtest/gtest.h>

#include "toolchain/dataset/mvhumannet_folder.h"
#include "toolchain/dataset/picture_reader.h"

namespace figurine::dataset::pictures_test {
namespace {

using Rgb = std::array<int, 3>;

std::string path(const std::string& name) { return FIGURINE_PICTURES "/" + name; }

Rgb pixel(const ports::ImageU8& image, uint32_t x, uint32_t y) {
  const uint8_t* p = image.at(x, y);
  return {p[0], p[1], p[2]};
}

void expect_near(const Rgb& got, const Rgb& wanted, const std::string& what) {
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(got[c], wanted[c], 6) << what << ", channel " << c;
}

TEST(Pictures, ColourIsWhatIsStored) {
  EXPECT_EQ(pixel(read_colour(path("colour.png")), 3, 5), (Rgb{200, 100, 20}));
  // 16 bits are no linear light: 0x8000 is 128, not 188.
  EXPECT_EQ(pixel(read_colour(path("colour16.png")), 3, 5), (Rgb{128, 64, 255}));
  const ports::ImageU8 palette = read_colour(path("palette_colour.png"));
  EXPECT_EQ(pixel(palette, 0, 0), (Rgb{200, 100, 50}));
  EXPECT_EQ(pixel(palette, 31, 0), (Rgb{10, 20, 30}));
  expect_near(pixel(read_colour(path("grey.jpg")), 0, 0), {200, 200, 200}, "grey JPEG");
  // Over black.
  EXPECT_EQ(pixel(read_colour(path("cutout.png")), 0, 0), (Rgb{90, 60, 30}));
  EXPECT_EQ(pixel(read_colour(path("cutout.png")), 31, 0), (Rgb{0, 0, 0}));
}

TEST(Pictures, AreTurnedUprightAsExifSays) {
  const Rgb red{200, 20, 20}, dark{20, 20, 20}, green{20, 200, 20}, yellow{200, 200, 20};
  // Corners of the upright picture: top left, top right, bottom left, bottom right.
  const std::array<std::array<Rgb, 4>, 8> wanted = {{{red, green, dark, yellow},
                                                     {green, red, yellow, dark},
                                                     {yellow, dark, green, red},
                                                     {dark, yellow, red, green},
                                                     {red, dark, green, yellow},
                                                     {dark, red, yellow, green},
                                                     {yellow, green, dark, red},
                                                     {green, yellow, red, dark}}};
  for (size_t turn = 0; turn < 8; ++turn) {
    const std::string file = path("exif" + std::to_string(turn + 1) + ".jpg");
    const ports::ImageU8 image = read_colour(file);
    const bool tall = turn >= 4;
    ASSERT_EQ(image.width_px, tall ? 16u : 32u) << file;
    ASSERT_EQ(image.height_px, tall ? 32u : 16u) << file;
    const PictureSize size = read_picture_size(file);
    EXPECT_EQ(size.width_px, image.width_px);
    EXPECT_EQ(size.height_px, image.height_px);
    const uint32_t right = image.width_px - 1, bottom = image.height_px - 1;
    expect_near(pixel(image, 0, 0), wanted[turn][0], file);
    expect_near(pixel(image, right, 0), wanted[turn][1], file);
    expect_near(pixel(image, 0, bottom), wanted[turn][2], file);
    expect_near(pixel(image, right, bottom), wanted[turn][3], file);
  }
}

TEST(Pictures, DamagedExifIsNoReasonToFail) {
  const test::TemporaryFolder folder;
  const std::string whole = test::read_text(path("exif6.jpg"));
  for (size_t at = 4; at < 50; ++at) {  // the segment ends there
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0xff);
    test::write_text(folder / "a.jpg", damaged);
    try {
      const ports::ImageU8 image = read_colour(folder / "a.jpg");
      EXPECT_EQ(image.width_px * image.height_px, 512u);
    } catch (const InputError& error) {
      EXPECT_LT(at, 6u) << "a segment's length is the picture's own: " << error.what();
    }
  }
}

TEST(Pictures, CmykIsRefusedByName) {
  EXPECT_NE(test::input_error([] { read_colour(path("cmyk.jpg")); }).find("CMYK"),
            std::string::npos);
}

TEST(Pictures, MasksOfEveryKindAre255Inside) {
  for (const char* name : {"mask.png", "mask1.png", "mask_palette.png", "mask_labels.png",
                           "mask_rgb.png", "cutout.png"}) {
    const ports::ImageU8 mask = read_mask(path(name));
    ASSERT_EQ(mask.channels, 1u);
    EXPECT_EQ(*mask.at(2, 3), 255) << name;
    EXPECT_EQ(*mask.at(30, 3), 0) << name;
  }
  EXPECT_EQ(*read_mask(path("mask16.png")).at(2, 3), 128) << "half covered, as stored";
}

TEST(Pictures, MasksThatSayNothingAreRefused) {
  const auto refusal = [](const char* name) {
    return test::input_error([&] { read_mask(path(name)); });
  };
  EXPECT_NE(refusal("mask_two_people.png").find("several colours"), std::string::npos);
  EXPECT_NE(refusal("mask_dim.png").find("brightest value is 38"), std::string::npos);
  EXPECT_NE(refusal("make.py").find("neither PNG nor JPEG"), std::string::npos);
}

}  // namespace
}  // namespace figurine::dataset::pictures_test
