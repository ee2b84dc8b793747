// Avatars with a table of their training poses' distances: what goes in comes out, what cannot be
// true is refused, and a reader who does not know the table, or does not want it, loses nothing.
#include <gtest/gtest.h>

#include <limits>

#include "figurine/known_poses.h"
#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"

namespace figurine::package_poses_test {
namespace {

using samples::AvatarSample;
using samples::ExactBytes;
using samples::expect_refused;
using samples::KnownPosesAvatarSample;
using samples::open_or_die;
using samples::Opened;
using samples::same;

Status with_distances(const std::vector<float>& distances) {
  KnownPosesAvatarSample sample;
  sample.avatar.pose_statistics.distances = distances;
  return sample.write().status();
}

TEST(PackagePoses, KeepTheTable) {
  const KnownPosesAvatarSample sample;
  const Opened opened = open_or_die(sample.write());
  const PoseStatistics& out = opened.package.avatar().pose_statistics;
  EXPECT_EQ(opened.package.optional_features(), kOptionalPoseDistances);
  EXPECT_EQ(opened.package.required_features(), 0u);  // a reader of before draws the same
  EXPECT_TRUE(same(out.distances, sample.avatar.pose_statistics.distances));
  const Result<KnownPoses> known = KnownPoses::create(out);
  ASSERT_TRUE(known.ok()) << known.status().message();
  EXPECT_FALSE(known->empty());
}

TEST(PackagePoses, WithoutATableThereIsNone) {
  const Opened opened = open_or_die(AvatarSample().write());
  EXPECT_EQ(opened.package.optional_features(), 0u);
  EXPECT_TRUE(opened.package.avatar().pose_statistics.distances.empty());
}

TEST(PackagePoses, TheTableIsABlobThatReadersMaySkip) {
  const KnownPosesAvatarSample sample;
  const PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
  size_t tables = 0;
  for (const BlobPart& part : parts.blobs) {
    if (part.name != "pose.distances") continue;
    EXPECT_TRUE(part.optional);
    ++tables;
  }
  EXPECT_EQ(tables, 1u);
}

TEST(PackagePoses, RejectTablesThatMeanNothing) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                  kInfinity = std::numeric_limits<float>::infinity();
  expect_refused(with_distances({1}), "pose.distances: has not 2 to 1025 values");
  expect_refused(with_distances(std::vector<float>(1026, 1)),
                 "pose.distances: has not 2 to 1025 values");
  expect_refused(with_distances({1, 2, 1.5f}), "pose.distances: value 2 is below the one before");
  for (const float bad : {kNan, kInfinity, -1.0f, 2e6f}) {
    expect_refused(with_distances({bad, 2e6f}), "pose.distances: value 0 is not within 0 and 1e6");
  }
  EXPECT_TRUE(with_distances({0, 0}).ok());
  EXPECT_TRUE(with_distances({0, 1e6f}).ok());
}

TEST(PackagePoses, RejectBlobsOfAnotherShapeOrType) {
  const auto bent = [](const auto& bend) {
    const KnownPosesAvatarSample sample;
    PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
    for (BlobPart& part : parts.blobs) {
      if (part.name == "pose.distances") bend(part);
    }
    const ExactBytes bytes(assemble(parts));
    return Package::open(bytes.bytes(), "bent.fgn").status();
  };
  expect_refused(bent([](BlobPart& part) { part.shape = {5, 1}; }),
                 "pose.distances: has shape [5,1]");
  expect_refused(bent([](BlobPart& part) { part.type = DataType::kU32; }),
                 "pose.distances: is u32, not f32");
}

TEST(PackagePoses, AreLeftOutOfDrawingUnlessItIsAskedFor) {
  const KnownPosesAvatarSample sample;
  const Result<std::vector<std::byte>> written = sample.write();
  ASSERT_TRUE(written.ok()) << written.status().message();
  const ExactBytes bytes(*written);
  const auto table = [&](const OpenOptions& options) {
    const Result<Package> package = Package::open(bytes.bytes(), "x.fgn", options);
    EXPECT_TRUE(package.ok()) << package.status().message();
    return package->avatar().pose_statistics.distances.size();
  };
  EXPECT_EQ(table({}), 5u);
  EXPECT_EQ(table(OpenOptions::for_drawing()), 0u);
  EXPECT_EQ(table(OpenOptions::for_drawing(Precision::kFloat32, true)), 5u);
}

}  // namespace
}  // namespace figurine::package_poses_test
