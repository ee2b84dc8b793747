// The order of images, the learning rate, the pose statistics: everything a resumed run has to
// repeat.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/random.h"
#include "toolchain/train/schedule.h"

namespace figurine::train {
namespace {

TEST(ShuffledOrder, VisitsEveryItemOncePerEpochInAFreshOrder) {
  ShuffledOrder order(7, 100);
  std::vector<size_t> first, second;
  for (uint64_t i = 0; i < 100; ++i) first.push_back(order.item(i));
  for (uint64_t i = 100; i < 200; ++i) second.push_back(order.item(i));
  EXPECT_EQ(std::set<size_t>(first.begin(), first.end()).size(), 100u);
  EXPECT_EQ(std::set<size_t>(second.begin(), second.end()).size(), 100u);
  EXPECT_NE(first, second);
}

TEST(ShuffledOrder, DependsOnIterationAloneNotOnWhatWasAskedBefore) {
  ShuffledOrder straight(3, 41), jumping(3, 41);
  std::vector<size_t> expected;
  for (uint64_t i = 0; i < 200; ++i) expected.push_back(straight.item(i));
  for (uint64_t i : {150u, 3u, 199u, 77u, 150u}) EXPECT_EQ(jumping.item(i), expected[i]);
}

TEST(ShuffledOrder, DiffersBySeed) {
  ShuffledOrder a(1, 1000), b(2, 1000);
  int equal = 0;
  for (uint64_t i = 0; i < 1000; ++i) equal += a.item(i) == b.item(i);
  EXPECT_LT(equal, 20);
}

TEST(RandomUnit, IsUniformWithinSamplingError) {
  double sum = 0, squares = 0;
  constexpr int kCount = 100000;
  for (uint64_t i = 0; i < kCount; ++i) {
    const double value = random_unit(5, 1, i);
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 3, 0.005);
}

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
}  // namespace figurine::train
