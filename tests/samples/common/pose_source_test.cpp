// Poses over time: recorded frames come back exactly, made-up ones never twice.
#include "samples/common/pose_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

namespace figurine::samples::pose_source_test {
namespace {

// Three frames of two joints; every number tells where it stands.
struct Clip {
  std::vector<float> translation, rotations;
  Motion motion;

  explicit Clip(float frames_per_second) {
    motion.frames_per_second = frames_per_second;
    motion.joint_names = {"root", "head"};
    motion.frame_count = 3;
    for (uint32_t i = 0; i < 3 * 3; ++i) translation.push_back(0.5f * static_cast<float>(i));
    for (uint32_t i = 0; i < 3 * 2 * 4; ++i) rotations.push_back(1 + static_cast<float>(i));
    motion.root_translation_m = translation;
    motion.rotations = rotations;
  }
};

void expect_frame(const Result<PoseView>& pose, const Clip& clip, uint32_t frame) {
  ASSERT_TRUE(pose.ok());
  const PoseView expected = clip.motion.pose(frame);
  EXPECT_EQ(pose->root_translation_m, expected.root_translation_m) << frame;
  EXPECT_EQ(pose->rotations.data(), expected.rotations.data()) << frame;
  EXPECT_EQ(pose->rotations.size(), 8u);
}

TEST(MotionPoses, GiveEveryFrameAtItsTime) {
  for (const float rate : {30.0f, 29.97f, 24.0f, 7.2f, 120.0f}) {
    const Clip clip(rate);
    MotionPoses poses(clip.motion);
    for (uint32_t frame = 0; frame < 3; ++frame)
      expect_frame(poses.next(poses.time_s(frame)), clip, frame);
  }
}

TEST(MotionPoses, GiveTheNearestFrameAndBeginAgain) {
  const Clip clip(10);
  MotionPoses poses(clip.motion);
  expect_frame(poses.next(0.04), clip, 0);
  expect_frame(poses.next(0.06), clip, 1);
  expect_frame(poses.next(0.29), clip, 0);
  for (const uint32_t frame : {3u, 4u, 5u, 300001u})
    expect_frame(poses.next(poses.time_s(frame)), clip, frame % 3);
}

TEST(SwayPoses, NeverGiveAPoseTwice) {
  const std::vector<float> rotations = {1, 0, 0, 0, 0.5f, 0.5f, 0.5f, 0.5f, 0, 1, 0, 0};
  SwayPoses poses({{1, 2, 3}, rotations});
  std::set<std::vector<float>> seen;
  for (int moment = 0; moment < 500; ++moment) {
    const Result<PoseView> pose = poses.next(moment / SwayPoses::kMomentsPerSecond);
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->root_translation_m, (std::array<float, 3>{1, 2, 3}));
    ASSERT_EQ(pose->rotations.size(), rotations.size());
    seen.insert({pose->rotations.begin(), pose->rotations.end()});
    for (size_t j = 0; j < 3; ++j) {
      const float* q = &pose->rotations[4 * j];
      EXPECT_NEAR(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])), 1, 1e-6);
      double inner = 0;
      for (size_t k = 0; k < 4; ++k) inner += double(q[k]) * rotations[4 * j + k];
      EXPECT_GE(inner, std::cos(0.05) - 1e-6) << "no more than 0.1 radians away";
    }
  }
  EXPECT_EQ(seen.size(), 500u);
}

TEST(StillPose, StaysAsItIs) {
  const std::vector<float> rotations = {1, 0, 0, 0};
  StillPose still({{0, 1, 0}, rotations});
  for (const double time_s : {0.0, 0.1, 1e6}) {
    const Result<PoseView> pose = still.next(time_s);
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->rotations.data(), rotations.data());
  }
}

}  // namespace
}  // namespace figurine::samples::pose_source_test
