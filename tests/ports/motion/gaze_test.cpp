// Head pitch of made-up clips, against angles known in closed form.
#include "ports/motion/gaze.h"

#include <cmath>
#include <numbers>

#include "figurine/pose.h"
#include "gtest/gtest.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports::gaze_test {
namespace {

constexpr float kDegree = std::numbers::pi_v<float> / 180;

// A clip of rest poses in which joints are bent about axes of their own.
class Clip {
 public:
  explicit Clip(uint32_t frames) {
    clip_.name = "test";
    clip_.frame_count = frames;
    clip_.root_translation_m.assign(size_t{frames} * 3, 0.5f);
    for (uint32_t i = 0; i < frames * kJointCount; ++i)
      clip_.rotations.insert(clip_.rotations.end(), {1, 0, 0, 0});
  }
  Clip& bend(uint32_t frame, uint32_t joint, int axis, float degrees) {
    float* q = &clip_.rotations[(size_t{frame} * kJointCount + joint) * 4];
    q[0] = std::cos(degrees * kDegree / 2);
    q[1 + axis] = std::sin(degrees * kDegree / 2);
    return *this;
  }
  operator const MotionClip&() const { return clip_; }

 private:
  MotionClip clip_;
};

TEST(HeadPitch, AddsUpAlongTheSpine) {
  // About +x, a positive angle lowers a face that looks along +z.
  const HeadPitch pitch = measure_head_pitch(Clip(2)
                                                 .bend(0, kSpine1, 0, 10)
                                                 .bend(0, kNeck, 0, 15)
                                                 .bend(0, kHead, 0, 5)
                                                 .bend(1, kHead, 0, -20));
  EXPECT_NEAR(pitch.lowest_rad, -30 * kDegree, 1e-5);
  EXPECT_NEAR(pitch.highest_rad, 20 * kDegree, 1e-5);
  EXPECT_NEAR(pitch.mean_rad, -5 * kDegree, 1e-5);
}

TEST(HeadPitch, DoesNotDependOnTheHeading) {
  const HeadPitch pitch =
      measure_head_pitch(Clip(1).bend(0, kPelvis, 1, 130).bend(0, kHead, 0, 25));
  EXPECT_NEAR(pitch.mean_rad, -25 * kDegree, 1e-5);
}

TEST(WithHeadPitch, LiftsTheMeanAndKeepsNods) {
  const MotionClip lowered =
      Clip(3).bend(0, kHead, 0, 30).bend(1, kHead, 0, 40).bend(2, kHead, 0, 50);
  const MotionClip level = *with_head_pitch(lowered, -5 * kDegree);
  const HeadPitch pitch = measure_head_pitch(level);
  EXPECT_NEAR(pitch.mean_rad, -5 * kDegree, 0.1 * kDegree);
  EXPECT_NEAR(pitch.highest_rad - pitch.lowest_rad, 20 * kDegree, 0.01 * kDegree);
  // Neck and head share the turn: 17.5 degrees each.
  const std::array<float, 9> neck =
      rotation_from_quaternion(&level.rotations[(size_t{kJointCount} + kNeck) * 4]);
  EXPECT_NEAR(std::asin(neck[5]), 17.5f * kDegree, 0.1 * kDegree);
  EXPECT_EQ(level.root_translation_m, lowered.root_translation_m);
  for (uint32_t joint = 0; joint < kJointCount; ++joint) {
    if (joint == kNeck || joint == kHead) continue;
    for (size_t k = 0; k < 4; ++k)
      ASSERT_EQ(level.rotations[joint * 4 + k], lowered.rotations[joint * 4 + k]) << joint;
  }
}

TEST(WithHeadPitch, FindsTheTurnOfAHeadHeldAskew) {
  // Rolled by 50 degrees: turned about its own axis, the face rises by less than it turns.
  const MotionClip level =
      *with_head_pitch(Clip(1).bend(0, kSpine3, 0, 25).bend(0, kNeck, 2, 50), 0);
  EXPECT_NEAR(measure_head_pitch(level).mean_rad, 0, 0.1 * kDegree);
}

TEST(WithHeadPitch, RefusesWhatNoNeckCanDo) {
  EXPECT_EQ(with_head_pitch(Clip(1).bend(0, kSpine1, 0, 85), 10 * kDegree).status().code(),
            StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace figurine::ports::gaze_test
