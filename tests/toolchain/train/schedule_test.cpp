// The learning rate, the pose statistics: everything a resumed run has to
// repeat.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/schedule.h"

namespace figurine::train::schedule_test {
namespace {

TEST(Schedule, RampsThenFollowsTheCosineToItsFloor) {
  const Schedule schedule{.peak = 1e-3,
                          .ramp_iterations = 50,
                          .floor_fraction = 0.02,
                          .budget = {.iterations = 1000, .seconds = 0}};
  EXPECT_NEAR(learning_rate(schedule, 0, 0), 1e-3 / 50, 1e-12);
  EXPECT_NEAR(learning_rate(schedule, 500, 0), 1e-3 * (0.02 + 0.98 * 0.5), 1e-9);
  EXPECT_NEAR(learning_rate(schedule, 1000, 0), 2e-5, 1e-12);
  EXPECT_NEAR(learning_rate(schedule, 2000, 0), 2e-5, 1e-12) << "never below the floor";
}

TEST(Schedule, OfATimeBudgetFollowsTrainingSeconds) {
  const Schedule schedule{.peak = 1,
                          .ramp_iterations = 1,
                          .floor_fraction = 0,
                          .budget = {.iterations = 0, .seconds = 60}};
  EXPECT_NEAR(learning_rate(schedule, 12345, 30), 0.5, 1e-12);
  EXPECT_NEAR(progress(schedule.budget, 12345, 60), 1, 0);
}

TEST(RotationVector, IsAxisTimesAngleForAnyLengthAndSign) {
  const double half = 0.35;  // rotation by 0.7 about y
  for (float scale : {1.0f, -1.0f, 12.5f}) {
    const float quaternion[] = {scale * float(std::cos(half)), 0, scale * float(std::sin(half)), 0};
    const std::array<double, 3> vector = rotation_vector(quaternion);
    EXPECT_NEAR(vector[1], 0.7, 1e-6);
    EXPECT_NEAR(vector[0], 0, 1e-9);
  }
  const float identity[] = {1, 0, 0, 0};
  EXPECT_EQ(rotation_vector(identity)[0], 0);
  const float half_turn[] = {0, 0, 0, 1};
  EXPECT_NEAR(rotation_vector(half_turn)[2], std::numbers::pi, 1e-9);
}

TEST(PoseFeatures, HaveTheirMeanAndARegularisedCovariance) {
  // Three joints; joint 2 turns about x by +-0.2, joint 1 never moves.
  std::vector<std::vector<float>> poses;
  for (float angle : {-0.2f, 0.2f})
    poses.push_back({1, 0, 0, 0, 1, 0, 0, 0, std::cos(angle / 2), std::sin(angle / 2), 0, 0});
  const PoseFeatures features = pose_features(poses, 3);
  EXPECT_EQ(features.joints, (std::vector<uint8_t>{1, 2}));
  for (float value : features.mean) EXPECT_NEAR(value, 0, 1e-7);
  EXPECT_NEAR(features.covariance[0], 9e-4, 1e-9) << "a joint that never moved keeps (0.03 rad)^2";
  EXPECT_NEAR(features.covariance[3 * 6 + 3], 0.04 + 9e-4, 1e-7);
  EXPECT_NEAR(features.covariance[3 * 6 + 4], 0, 1e-9);
}

}  // namespace
}  // namespace figurine::train::schedule_test
