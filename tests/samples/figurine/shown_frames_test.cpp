#include "samples/figurine/shown_frames.h"

#include <gtest/gtest.h>

#include <numeric>

namespace figurine::tests::shown_frames_test {
namespace {

using samples::frames_in_time;
using samples::ShownFrames;
using samples::turntable_frames;

std::vector<uint32_t> first(uint32_t count) {
  std::vector<uint32_t> frames(count);
  std::iota(frames.begin(), frames.end(), 0u);
  return frames;
}

TEST(ShownFrames, WithoutARateEachFrameIsShownOnce) {
  const ShownFrames shown = frames_in_time({3, 5, 7}, 15, {});
  EXPECT_EQ(shown.frames, (std::vector<uint32_t>{3, 5, 7}));
  EXPECT_EQ(shown.frames_per_second, 15);
  EXPECT_EQ(shown.note, "");
}

TEST(ShownFrames, OfAFasterMotionFramesAreLeftOut) {
  const ShownFrames shown = frames_in_time(first(13), 120, 30);
  EXPECT_EQ(shown.frames, (std::vector<uint32_t>{0, 4, 8}));
  EXPECT_EQ(shown.frames_per_second, 30);
  EXPECT_EQ(shown.note, "a motion of 120 frames a second, shown at 30: one frame of 4");
  EXPECT_EQ(frames_in_time(first(10), 60, 30).note,
            "a motion of 60 frames a second, shown at 30: every other frame");
}

TEST(ShownFrames, OfASlowerMotionFramesAreRepeated) {
  const ShownFrames shown = frames_in_time(first(3), 30, 60);
  EXPECT_EQ(shown.frames, (std::vector<uint32_t>{0, 0, 1, 1, 2, 2}));
  EXPECT_EQ(shown.note, "a motion of 30 frames a second, shown at 60: frames are shown 2 times");
}

// Over any number of frames no moment is further than one frame of the motion from its own.
TEST(ShownFrames, RatesThatDoNotDivideKeepRealTime) {
  for (const double fps : {24.0, 25.0, 29.97, 50.0, 59.94}) {
    const ShownFrames shown = frames_in_time(first(1000), 60, fps);
    EXPECT_NEAR(static_cast<double>(shown.frames.size()) / fps, 1000 / 60.0, 1 / fps);
    for (size_t i = 0; i < shown.frames.size(); ++i) {
      const double late_s = static_cast<double>(i) / fps - shown.frames[i] / 60.0;
      ASSERT_GE(late_s, -1e-6) << fps << " " << i;
      ASSERT_LT(late_s, 1 / 60.0) << fps << " " << i;
    }
  }
}

TEST(ShownFrames, OneFrameIsShownOnceAtAnyRate) {
  EXPECT_EQ(frames_in_time({7}, 30, 60).frames, std::vector<uint32_t>{7});
}

TEST(ShownFrames, ATurnStartsAMotionAgainAndHoldsAFrame) {
  EXPECT_EQ(turntable_frames({4, 5, 6}, 30, {}, 5).frames, (std::vector<uint32_t>{4, 5, 6, 4, 5}));
  EXPECT_EQ(turntable_frames({4, 5, 6}, 60, 30, 4).frames, (std::vector<uint32_t>{4, 6, 5, 4}));
  const ShownFrames held = turntable_frames({9}, 30, 12, 3);
  EXPECT_EQ(held.frames, (std::vector<uint32_t>{9, 9, 9}));
  EXPECT_EQ(held.frames_per_second, 12);
  EXPECT_EQ(held.note, "");
}

}  // namespace
}  // namespace figurine::tests::shown_frames_test
