// The small languages of the command line: what they accept, what it means, and what they refuse.
#include "samples/common/parse.h"

#include <gtest/gtest.h>

namespace figurine::samples::parse_test {
namespace {

TEST(ParseSize, TakesWidthAndHeight) {
  const Result<ImageSize> size = parse_size("1024x750");
  ASSERT_TRUE(size.ok());
  EXPECT_EQ(size->width_px, 1024u);
  EXPECT_EQ(size->height_px, 750u);
}

TEST(ParseSize, RefusesEverythingElse) {
  for (const char* text : {"", "512", "512x", "x512", "512X512", "0x4", "4x0", "16385x1", "-1x4",
                           "4x4x4", "4 x4", "1e3x4", "99999999999x1"}) {
    EXPECT_FALSE(parse_size(text).ok()) << text;
  }
}

TEST(ParseFrames, TakesOneFrameRangesAndSteps) {
  const auto expect = [](const char* text, uint32_t first, std::optional<uint32_t> end,
                         uint32_t step) {
    const Result<FrameRange> range = parse_frames(text);
    ASSERT_TRUE(range.ok()) << text;
    EXPECT_EQ(range->first, first) << text;
    EXPECT_EQ(range->end, end) << text;
    EXPECT_EQ(range->step, step) << text;
  };
  expect("12", 12, 13, 1);
  expect("10:40", 10, 40, 1);
  expect("10:40:4", 10, 40, 4);
  expect("10:", 10, std::nullopt, 1);
  expect(":", 0, std::nullopt, 1);
  expect("::3", 0, std::nullopt, 3);
  expect(":7", 0, 7, 1);
}

TEST(ParseFrames, RefusesEverythingElse) {
  for (const char* text : {"", "a", "1:a", "5:5", "6:5", "1:9:0", "1:9:", "1:2:3:4", "-1:4", "1.5",
                           "4294967295", "99999999999"}) {
    EXPECT_FALSE(parse_frames(text).ok()) << text;
  }
}

TEST(ParseBackground, TakesNamesCodesAndNumbers) {
  EXPECT_FALSE(parse_background("alpha")->colour.has_value());
  EXPECT_EQ((*parse_background("#ff8000")->colour)[0], 1.0f);
  EXPECT_EQ((*parse_background("#ff8000")->colour)[1], 128.0f / 255);
  EXPECT_EQ((*parse_background("#FF8000")->colour)[2], 0.0f);
  EXPECT_EQ((*parse_background("0.25,0.5,1")->colour)[0], 0.25f);
  for (const char* text : {"", "#12345", "#1234567", "#gg0000", "1,2", "1,1,1,1", "1.5,0,0",
                           "-0.1,0,0", "nan,0,0", "inf,0,0", "blue"}) {
    EXPECT_FALSE(parse_background(text).ok()) << text;
  }
}

TEST(ParsePlacement, TakesPlaceAndHeading) {
  const Result<Placement> place = parse_placement("1.5,-2,90");
  ASSERT_TRUE(place.ok());
  EXPECT_EQ(place->x_m, 1.5f);
  EXPECT_EQ(place->z_m, -2.0f);
  EXPECT_EQ(place->heading_deg, 90.0f);
  EXPECT_EQ(parse_placement("0,1")->heading_deg, 0.0f);
  for (const char* text : {"", "1", "1,", "a,b", "1,2,3,4", "1e9,0", "nan,0"})
    EXPECT_FALSE(parse_placement(text).ok()) << text;
}

TEST(NumberedName, PutsTheNumberWhereItBelongs) {
  EXPECT_EQ(NumberedName::parse("a/x_%04d.png")->name(7), "a/x_0007.png");
  EXPECT_EQ(NumberedName::parse("x%d.png")->name(12), "x12.png");
  EXPECT_EQ(NumberedName::parse("%03d.png")->name(12345), "12345.png");
  EXPECT_EQ(NumberedName::parse("x.png")->name(3), "x.png");
  EXPECT_FALSE(NumberedName::parse("x.png")->numbered());
}

TEST(NumberedName, IsNoPrintfFormat) {
  for (const char* text : {"x%s.png", "x%.png", "x%n", "%04d%04d.png", "x%%.png", "x%4d.png", "x%0",
                           "x%00d.png", "x%099d.png", "x%d%s"}) {
    EXPECT_FALSE(NumberedName::parse(text).ok()) << text;
  }
}

}  // namespace
}  // namespace figurine::samples::parse_test
