// What a package says of its training poses: mean and covariance by hand, distances that are not
// flattered, and the same package with other statistics.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "figurine/known_poses.h"
#include "formats/writer/package_writer.h"
#include "toolchain/error.h"
#include "toolchain/train/known_poses.h"

namespace figurine::train::known_poses_test {
namespace {

using Poses = std::vector<std::vector<float>>;

// Three joints; the last one turns about x.
std::vector<float> bent(float angle) {
  return {1, 0, 0, 0, 1, 0, 0, 0, std::cos(angle / 2), std::sin(angle / 2), 0, 0};
}

TEST(KnownPoseStatistics, HaveTheirMeanAndARegularisedCovariance) {
  const KnownPoseStatistics known = known_poses({bent(-0.2f), bent(0.2f)}, 3);
  EXPECT_EQ(known.joints, (std::vector<uint8_t>{0, 1, 2}));
  for (float value : known.mean) EXPECT_NEAR(value, 0, 1e-7);
  EXPECT_NEAR(known.covariance[3 * 9 + 3], 9e-4, 1e-9)
      << "a joint that never moved keeps (0.03 rad)^2";
  EXPECT_NEAR(known.covariance[6 * 9 + 6], 0.04 + 9e-4, 1e-7);
  EXPECT_NEAR(known.covariance[6 * 9 + 7], 0, 1e-9);
  // Each against the other one: 0.4 rad off, the deviation of a joint that never moved.
  ASSERT_EQ(known.distances.size(), kPoseDistances);
  for (const float distance : known.distances) EXPECT_NEAR(distance, 0.4 / 0.03, 1e-4);
}

TEST(KnownPoseStatistics, OfOnePoseAreThatPose) {
  const KnownPoseStatistics known = known_poses({bent(0.3f)}, 3);
  EXPECT_NEAR(known.mean[6], 0.3, 1e-6);
  for (const float distance : known.distances) EXPECT_NEAR(distance, 0, 1e-4);
  EXPECT_THROW(known_poses({}, 3), InputError);
}

TEST(KnownPoseStatistics, HeadingsAreNeitherUsualNorUnusual) {
  Poses facing, turned;
  for (int i = 0; i < 20; ++i) {
    facing.push_back(bent(0.02f * static_cast<float>(i)));
    turned.push_back(facing.back());
    const float half = 0.7f * static_cast<float>(i);
    turned.back()[0] = std::cos(half), turned.back()[2] = std::sin(half);
  }
  const KnownPoseStatistics a = known_poses(facing, 3), b = known_poses(turned, 3);
  for (size_t i = 0; i < a.mean.size(); ++i) EXPECT_NEAR(a.mean[i], b.mean[i], 1e-6);
  for (size_t i = 0; i < a.distances.size(); ++i)
    EXPECT_NEAR(a.distances[i], b.distances[i], 1e-3 * a.distances[i]);
}

// Poses from one distribution in many dimensions: of new ones as many are beyond a share of the
// training poses as the table says, though there are few.
TEST(KnownPoseStatistics, TheTableHoldsForPosesThatWereNotTrainedOn) {
  constexpr uint32_t kJoints = 22;
  std::mt19937 random(1);  // its numbers are the same everywhere; their sums are, too
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f - 0.5f; };
  const auto draw = [&] {
    std::vector<float> pose;
    for (uint32_t j = 0; j < kJoints; ++j) {
      pose.push_back(1);
      for (int k = 0; k < 3; ++k) pose.push_back(0.1f * (uniform() + uniform() + uniform()));
    }
    return pose;
  };
  Poses training(100);
  for (std::vector<float>& pose : training) pose = draw();
  const KnownPoseStatistics statistics = known_poses(training, kJoints);
  const KnownPoses known = value_or_throw(KnownPoses::create(statistics.view()), "test");
  constexpr int kNew = 2000;
  double beyond_half = 0, beyond_all = 0, flattered = 0;
  for (int i = 0; i < kNew; ++i) {
    const double share = known.rarity(draw()).share_beyond;
    beyond_half += share < 0.5 ? 1.0 / kNew : 0;
    beyond_all += share == 0 ? 1.0 / kNew : 0;
  }
  for (const std::vector<float>& pose : training)
    flattered += known.rarity(pose).share_beyond == 1 ? 0.01 : 0;
  std::printf(
      "beyond half of the training poses %.2f, beyond all %.2f of new ones; training poses "
      "nearer than the table %.2f\n",
      beyond_half, beyond_all, flattered);
  // A table from 7/8 of the poses is a little wide for the whole of them, never narrow.
  EXPECT_GT(beyond_half, 0.1);
  EXPECT_LT(beyond_half, 0.6);
  EXPECT_LT(beyond_all, 0.05);
  EXPECT_GT(flattered, 0.5) << "by its own statistics a training pose is nearer than it is";
}

}  // namespace
}  // namespace figurine::train::known_poses_test
