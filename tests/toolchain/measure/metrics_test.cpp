// Picture metrics against values computed by hand.
#include "toolchain/measure/metrics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::measure::metrics_test {
namespace {

Picture filled(uint32_t width, uint32_t height, std::array<uint8_t, 4> rgba) {
  Picture picture{width, height, {}};
  for (uint32_t i = 0; i < width * height; ++i)
    picture.rgba.insert(picture.rgba.end(), rgba.begin(), rgba.end());
  return picture;
}

void set(Picture& picture, int x, int y, std::array<uint8_t, 4> rgba) {
  std::copy(rgba.begin(), rgba.end(), &picture.rgba[(size_t(y) * picture.width_px + x) * 4]);
}

TEST(Psnr, OfAConstantErrorIsItsLogarithm) {
  const Picture truth = filled(5, 4, {100, 100, 100, 255});
  const Picture prediction = filled(5, 4, {151, 151, 151, 255});  // 51/255 = 0.2 everywhere
  EXPECT_NEAR(foreground_error(prediction, truth).psnr_db(), -20 * std::log10(0.2), 1e-5);
  EXPECT_EQ(foreground_error(prediction, truth).count, 60u);
}

TEST(Psnr, CountsOnlyPixelsWhoseTrueAlphaExceedsOneHalf) {
  Picture truth = filled(3, 1, {0, 0, 0, 0});
  set(truth, 0, 0, {255, 0, 0, 255});
  set(truth, 1, 0, {127, 0, 0, 127});  // 0.498: background
  Picture prediction = truth;
  set(prediction, 1, 0, {0, 0, 0, 0});
  set(prediction, 2, 0, {255, 255, 255, 255});
  EXPECT_EQ(foreground_error(prediction, truth).count, 3u);
  EXPECT_EQ(foreground_error(prediction, truth).sum, 0);
  EXPECT_TRUE(std::isinf(foreground_error(prediction, truth).psnr_db()));
}

TEST(Psnr, SeesAHoleAsMidGrey) {
  const Picture truth = filled(2, 2, {255, 255, 255, 255});
  const Picture hole = filled(2, 2, {0, 0, 0, 0});
  EXPECT_NEAR(foreground_error(hole, truth).psnr_db(), -20 * std::log10(0.5), 1e-6);
}

TEST(Psnr, OfNoPixelIsNotANumber) {
  const Picture nobody = filled(2, 2, {0, 0, 0, 0});
  EXPECT_TRUE(std::isnan(foreground_error(nobody, nobody).psnr_db()));
}

TEST(Psnr, PoolsSquaresBeforeTheLogarithm) {
  const Picture truth = filled(1, 1, {0, 0, 0, 255});
  SquaredError pooled = foreground_error(filled(1, 1, {51, 51, 51, 255}), truth);  // 0.2
  pooled.add(foreground_error(truth, truth));
  EXPECT_NEAR(pooled.psnr_db(), -10 * std::log10(0.02), 1e-5);
}

TEST(Psnr, InsideABoxIsClippedToThePicture) {
  const Picture truth = filled(4, 4, {0, 0, 0, 255});
  EXPECT_EQ(foreground_error(truth, truth, {2, 2, 9, 9}).count, 12u);
  EXPECT_EQ(foreground_error(truth, truth, {-5, -5, 1, 1}).count, 3u);
}

TEST(CropError, LooksAtTheMaskBoxOverBlack) {
  Picture truth = filled(6, 6, {0, 0, 0, 0});
  set(truth, 1, 1, {51, 51, 51, 255});
  set(truth, 3, 2, {51, 51, 51, 1});  // any alpha counts for the box
  const Picture nothing = filled(6, 6, {0, 0, 0, 0});
  const SquaredError error = crop_error(nothing, truth);
  EXPECT_EQ(error.count, 3u * 2u * 3u);  // columns 1..3, rows 1..2
  EXPECT_NEAR(error.sum, 2 * 3 * 0.04, 1e-12);
}

TEST(FlatColour, FindsTheColourAndItsError) {
  // Two opaque pixels, 0 and 1 in red: best red 0.5, error 0.25 each; green and blue constant.
  Picture truth = filled(2, 1, {0, 102, 204, 255});
  set(truth, 1, 0, {255, 102, 204, 255});
  FlatColour flat;
  flat.add(truth);
  EXPECT_NEAR(flat.colour()[0], 0.5, 1e-12);
  EXPECT_NEAR(flat.colour()[1], 0.4, 1e-12);
  EXPECT_NEAR(flat.error().sum, 0.5, 1e-9);
  EXPECT_NEAR(flat.error().psnr_db(), -10 * std::log10(0.5 / 6), 1e-6);
}

TEST(FlatColour, EqualsTheErrorOfThatPicture) {
  Picture truth = filled(16, 16, {0, 0, 0, 0});
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      const int alpha = std::min(255, 40 * x);
      set(truth, x, y,
          {uint8_t(alpha * ((x * 7 + y * 13) % 11) / 11), uint8_t(alpha * (y % 5) / 5),
           uint8_t(alpha * (x % 3) / 3), uint8_t(alpha)});
    }
  }
  FlatColour flat;
  flat.add(truth);
  std::vector<float> drawn(truth.rgba.size());
  for (size_t i = 0; i < drawn.size(); i += 4) {
    const float alpha = float(truth.rgba[i + 3]) / 255;
    for (int c = 0; c < 3; ++c) drawn[i + c] = alpha * float(flat.colour()[c]);
    drawn[i + 3] = alpha;
  }
  // The drawn picture is rounded to 8 bits, half a step at most.
  const double drawn_db = foreground_error(quantise_picture(16, 16, drawn), truth).psnr_db();
  EXPECT_NEAR(flat.error().psnr_db(), drawn_db, 0.05);
}

TEST(Outlines, AreComparedByUnionAndByWhatIsLeftUncovered) {
  Picture truth = filled(4, 1, {0, 0, 0, 0}), prediction = truth;
  for (int x : {0, 1, 2}) set(truth, x, 0, {9, 9, 9, 255});
  for (int x : {2, 3}) set(prediction, x, 0, {9, 9, 9, 128});
  set(prediction, 1, 0, {9, 9, 9, 127});  // below a half
  EXPECT_DOUBLE_EQ(compare_outlines(prediction, truth).iou(), 0.25);
  EXPECT_DOUBLE_EQ(compare_outlines(prediction, truth).uncovered_share(), 2.0 / 3);
  EXPECT_EQ(compare_outlines(filled(1, 1, {}), filled(1, 1, {})).iou(), 0);
}

TEST(HighPass, OfEqualPicturesIsOneAndOfAFlatOneZero) {
  Picture truth = filled(9, 9, {0, 0, 0, 255});
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x) {
      if ((x + y) % 2 == 0) set(truth, x, y, {255, 255, 255, 255});
    }
  }
  EXPECT_NEAR(high_pass(truth, truth).ratio(), 1, 1e-12);
  EXPECT_NEAR(high_pass(filled(9, 9, {128, 128, 128, 255}), truth).ratio(), 0, 1e-12);
  // A checkerboard's 3x3 mean is 5/9 on white and 4/9 on black: each of 7x7 inner pixels and 3
  // channels has energy (4/9)^2.
  EXPECT_NEAR(high_pass(truth, truth).truth, 49 * 3 * 16.0 / 81, 1e-6);
}

// One bright pixel in a grey picture: high-pass 8/9 of its height there, -1/9 at the eight around
// it, so that its energy is 8/9 of its height squared.
Picture with_dot(int x, int y, uint8_t level) {
  Picture picture = filled(12, 12, {51, 51, 51, 255});
  set(picture, x, y, {level, level, level, 255});
  return picture;
}

TEST(HighPass, OfADotIsEightNinthsOfItsHeightSquared) {
  const HighPass both = high_pass(with_dot(5, 5, 102), with_dot(5, 5, 153));  // 0.2 and 0.4 high
  EXPECT_NEAR(both.truth, 3 * 8.0 / 9 * 0.16, 1e-6);
  EXPECT_NEAR(both.ratio(), 0.25, 1e-6);
  EXPECT_NEAR(both.correlation(), 1, 1e-6) << "half as sharp, but the same detail";
}

TEST(HighPass, CorrelationTellsDetailFromNoise) {
  // A dot far from the truth's: as sharp, and nothing in common.
  const HighPass elsewhere = high_pass(with_dot(8, 5, 153), with_dot(3, 5, 153));
  EXPECT_NEAR(elsewhere.ratio(), 1, 1e-6);
  EXPECT_NEAR(elsewhere.correlation(), 0, 1e-6);
  // Dark instead of bright: the opposite detail.
  EXPECT_NEAR(high_pass(with_dot(5, 5, 0), with_dot(5, 5, 102)).correlation(), -1, 1e-6);
  // Right beside it: -1/9 meets 8/9 twice, and (-1/9)^2 four times; over 8/9.
  EXPECT_NEAR(high_pass(with_dot(6, 5, 153), with_dot(5, 5, 153)).correlation(),
              (-2 * 8.0 / 81 + 4 * 1.0 / 81) / (8.0 / 9), 1e-6);
  EXPECT_EQ(high_pass(filled(12, 12, {51, 51, 51, 255}), with_dot(5, 5, 153)).correlation(), 0);
}

TEST(HighPass, PoolsEnergiesBeforeTheRatio) {
  HighPass pooled = high_pass(with_dot(5, 5, 153), with_dot(5, 5, 153));
  pooled.add(high_pass(with_dot(8, 5, 153), with_dot(3, 5, 153)));
  EXPECT_NEAR(pooled.ratio(), 1, 1e-6);
  EXPECT_NEAR(pooled.correlation(), 0.5, 1e-6);
}

TEST(Filled, LooksThreePixelsInsideTheMask) {
  // 9x9 of foreground in 13x13: 3x3 pixels are more than 3 away from its outline.
  Picture truth = filled(13, 13, {0, 0, 0, 0});
  for (int y = 2; y < 11; ++y) {
    for (int x = 2; x < 11; ++x) set(truth, x, y, {9, 9, 9, 255});
  }
  Picture prediction = truth;
  EXPECT_EQ(count_filled(prediction, truth).inside, 9u);
  EXPECT_EQ(count_filled(prediction, truth).share(), 1);
  set(prediction, 6, 6, {9, 9, 9, 250});  // 0.9804
  EXPECT_EQ(count_filled(prediction, truth).filled, 9u);
  set(prediction, 6, 6, {9, 9, 9, 249});  // 0.9765
  set(prediction, 4, 6, {0, 0, 0, 0});    // two from the outline: no hole
  EXPECT_EQ(count_filled(prediction, truth).filled, 8u);
  // What can be seen through in truth has nothing to fill, but is foreground to its neighbours.
  set(truth, 6, 6, {9, 9, 9, 249});
  EXPECT_EQ(count_filled(prediction, truth).inside, 8u);
  EXPECT_EQ(count_filled(prediction, truth).filled, 8u);
  set(truth, 6, 6, {9, 9, 9, 127});
  EXPECT_TRUE(std::isnan(count_filled(prediction, truth).share()));
}

TEST(Filled, LeavesOutWhereThePictureCutsThePerson) {
  const Picture truth = filled(8, 7, {9, 9, 9, 255});
  EXPECT_EQ(count_filled(truth, truth).inside, 2u) << "nobody knows what lies beyond the border";
}

TEST(HighPass, LeavesTheSilhouetteOut) {
  Picture truth = filled(7, 7, {0, 0, 0, 0});
  for (int y = 2; y < 5; ++y) {
    for (int x = 2; x < 5; ++x) set(truth, x, y, {255, 255, 255, 255});
  }
  EXPECT_EQ(high_pass(truth, truth).truth, 0)
      << "only the centre has eight foreground neighbours, and it is flat there";
}

TEST(FrameDifference, OfStillPredictionIsTheTruthsOwnChange) {
  const Picture still = filled(3, 3, {100, 100, 100, 255});
  const Picture moved = filled(3, 3, {151, 151, 151, 255});
  EXPECT_NEAR(difference_error(still, still, still, moved).psnr_db(), -20 * std::log10(0.2), 1e-5);
  // A constant offset in both frames is no shimmer.
  EXPECT_LT(difference_error(moved, moved, still, still).sum, 1e-12);
}

TEST(QuantisePicture, ClampsRoundsAndSurvivesNaN) {
  const float values[] = {-1.0f, 0.5f, 2.0f, std::nanf("")};
  const Picture picture = quantise_picture(1, 1, values);
  EXPECT_EQ(picture.rgba, (std::vector<uint8_t>{0, 128, 255, 0}));
}

TEST(BoundingBox, IsEmptyWithoutAlpha) {
  EXPECT_TRUE(bounding_box(filled(3, 3, {9, 9, 9, 0})).empty());
  Picture one = filled(5, 5, {0, 0, 0, 0});
  set(one, 3, 1, {0, 0, 0, 1});
  const Box box = bounding_box(one);
  EXPECT_EQ(box.x0, 3);
  EXPECT_EQ(box.x1, 4);
  EXPECT_EQ(box.y0, 1);
  EXPECT_EQ(box.y1, 2);
}

}  // namespace
}  // namespace figurine::measure::metrics_test
