// Avatars that keep to the poses that they know: nothing changes unless it is asked for, nothing
// changes for a pose inside, and outside the network alone is shown another one.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "figurine/known_poses.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::keep_to_known_test {
namespace {

using tests::SyntheticBody;
using tests::SyntheticPose;

// A test avatar that knows poses about the rest pose.
struct KnowingAvatar {
  tests::SyntheticAvatar written;
  Avatar avatar;

  KnowingAvatar(const SyntheticBody& body, tests::Held held, uint32_t network_step = 1)
      : written(tests::make_test_avatar(body, {.held = held,
                                               .network_step = network_step,
                                               .static_part = true,
                                               .known_poses = true})),
        avatar(written.package->avatar()) {}
};

class KeepToKnown : public ::testing::TestWithParam<tests::Held> {
 protected:
  KeepToKnown() { id_ = add(*renderer_, knowing_.avatar); }

  AvatarId add(Renderer& renderer, const Avatar& avatar) const {
    const Result<AvatarId> id = renderer.add_avatar(avatar, *body_.package);
    FIG_CHECK(id.ok(), id.status().message().c_str());
    return *id;
  }
  std::vector<float> draw(const FrameAvatar& seen, const Approximation& approximation = {}) {
    return tests::render(*renderer_,
                         {.camera = camera_, .avatars = {&seen, 1}, .approximation = approximation})
        .rgba;
  }
  SyntheticPose pose(uint32_t frame) const { return tests::make_test_pose(body_.body(), frame); }
  KnownPoses known() const {
    return std::move(KnownPoses::create(knowing_.avatar.pose_statistics)).value();
  }
  // What the network is shown of a pose that is outside.
  SyntheticPose pulled(const SyntheticPose& from) const {
    SyntheticPose to = from;
    EXPECT_TRUE(known().pull(from.rotations, to.rotations));
    return to;
  }

  SyntheticBody body_ = tests::make_test_body();
  KnowingAvatar knowing_{body_, GetParam()};
  std::unique_ptr<Renderer> renderer_ = tests::make_renderer();
  AvatarId id_{};
  Camera camera_ = tests::make_test_camera(80, 80, 20);
};

TEST_P(KeepToKnown, IsOffUnlessAskedFor) {
  const SyntheticPose outside = pose(3);
  ASSERT_GT(known().distance(outside.rotations), 2);
  const std::vector<float> before = draw({.avatar = id_, .pose = outside.view()});
  EXPECT_EQ(renderer_->statistics().pulled_poses, 0u);
  const std::vector<float> kept =
      draw({.avatar = id_, .pose = outside.view(), .keep_to_known = true});
  EXPECT_EQ(renderer_->statistics().pulled_poses, 1u);
  EXPECT_NE(kept, before);
  EXPECT_EQ(draw({.avatar = id_, .pose = outside.view()}), before);
}

TEST_P(KeepToKnown, ChangesNoBitOfAPoseInside) {
  SyntheticPose inside = pose(0);
  for (const float bend : {0.0f, 0.05f, 0.1f, 0.15f}) {
    inside.rotations[5] = bend;
    ASSERT_LT(known().distance(inside.rotations), known().distance_beyond(1 - kKnownShare));
    const std::vector<float> before = draw({.avatar = id_, .pose = inside.view()});
    EXPECT_EQ(draw({.avatar = id_, .pose = inside.view(), .keep_to_known = true}), before);
    EXPECT_EQ(renderer_->statistics().pulled_poses, 0u);
  }
}

// The same picture by another way: the network has run for the pulled pose, and does not run for
// the true one.
TEST_P(KeepToKnown, ShowsThePulledPoseToTheNetworkAlone) {
  for (const uint32_t network_step : {1u, 2u}) {
    const KnowingAvatar other(body_, GetParam(), network_step);
    const AvatarId id = add(*renderer_, other.avatar);
    for (const uint32_t frame : {2u, 3u, 5u}) {
      const SyntheticPose outside = pose(frame), near = pulled(outside);
      const std::vector<float> kept =
          draw({.avatar = id, .pose = outside.view(), .keep_to_known = true});
      draw({.avatar = id, .pose = near.view()});
      const std::vector<float> stale =
          draw({.avatar = id, .pose = outside.view()}, {.network_below_px = 4096});
      EXPECT_EQ(renderer_->statistics().stale_networks, 1u);
      EXPECT_EQ(kept, stale);
    }
  }
}

TEST_P(KeepToKnown, ARunIsSparedForWhatTheNetworkWasShownLast) {
  const SyntheticPose outside = pose(3), near = pulled(outside);
  draw({.avatar = id_, .pose = outside.view(), .keep_to_known = true});
  EXPECT_EQ(renderer_->statistics().networks, 1u);
  draw({.avatar = id_, .pose = outside.view(), .keep_to_known = true});
  EXPECT_EQ(renderer_->statistics().left_out.unchanged_networks, 1u);
  draw({.avatar = id_, .pose = near.view()});
  EXPECT_EQ(renderer_->statistics().left_out.unchanged_networks, 1u);
  draw({.avatar = id_, .pose = outside.view()});
  EXPECT_EQ(renderer_->statistics().networks, 1u) << "the true pose is another one";
}

TEST_P(KeepToKnown, IsEachFiguresOwn) {
  const SyntheticPose outside = pose(3);
  const FrameAvatar two[] = {{.avatar = id_, .pose = outside.view(), .keep_to_known = true},
                             {.avatar = id_, .pose = outside.view()}};
  tests::render(*renderer_, {.camera = camera_, .avatars = two});
  EXPECT_EQ(renderer_->statistics().pulled_poses, 1u);
  EXPECT_EQ(renderer_->statistics().networks, 2u);
}

TEST_P(KeepToKnown, WithoutATableNothingChangesAndNothingIsSaid) {
  Avatar silent = knowing_.avatar;
  silent.pose_statistics.distances = {};
  const AvatarId id = add(*renderer_, silent);
  const SyntheticPose outside = pose(3);
  const std::vector<float> before = draw({.avatar = id, .pose = outside.view()});
  EXPECT_EQ(draw({.avatar = id, .pose = outside.view(), .keep_to_known = true}), before);
  EXPECT_EQ(renderer_->statistics().pulled_poses, 0u);
  const auto rarity = renderer_->pose_rarity(id, outside.view());
  ASSERT_TRUE(rarity.ok());
  EXPECT_FALSE(rarity->has_value());
}

TEST_P(KeepToKnown, SaysHowUnusualAPoseIs) {
  for (const uint32_t frame : {0u, 1u, 4u}) {
    const SyntheticPose at = pose(frame);
    const auto rarity = renderer_->pose_rarity(id_, at.view());
    ASSERT_TRUE(rarity.ok()) << rarity.status().message();
    ASSERT_TRUE(rarity->has_value());
    const PoseRarity expected = known().rarity(at.rotations);
    EXPECT_EQ((*rarity)->distance, expected.distance);
    EXPECT_EQ((*rarity)->share_beyond, expected.share_beyond);
  }
  EXPECT_EQ((*renderer_->pose_rarity(id_, pose(0).view()))->share_beyond, 1);
  EXPECT_EQ((*renderer_->pose_rarity(id_, pose(4).view()))->share_beyond, 0);
  SyntheticPose unsound = pose(1);
  unsound.rotations[4] = unsound.rotations[5] = unsound.rotations[6] = unsound.rotations[7] = 0;
  EXPECT_EQ(renderer_->pose_rarity(id_, unsound.view()).status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(renderer_->pose_rarity(AvatarId(99), pose(1).view()).status().code(),
            StatusCode::kInvalidArgument);
}

// What differs in what it knows is not held as one.
TEST_P(KeepToKnown, AvatarsThatKnowOtherPosesAreOthers) {
  Avatar wider = knowing_.avatar;
  const std::vector<float> distances{10, 20};
  wider.pose_statistics.distances = distances;
  const AvatarId other = add(*renderer_, wider), same = add(*renderer_, knowing_.avatar);
  const SyntheticPose outside = pose(3);
  const FrameAvatar three[] = {{.avatar = id_, .pose = outside.view(), .keep_to_known = true},
                               {.avatar = other, .pose = outside.view(), .keep_to_known = true},
                               {.avatar = same, .pose = outside.view(), .keep_to_known = true}};
  tests::render(*renderer_, {.camera = camera_, .avatars = three});
  EXPECT_EQ(renderer_->statistics().pulled_poses, 2u);
}

TEST_P(KeepToKnown, HasTheSamePixelsWithAnyThreadsAndInstructionSet) {
  const SyntheticPose outside = pose(3);
  const std::vector<float> truth =
      draw({.avatar = id_, .pose = outside.view(), .keep_to_known = true});
  for (const Isa isa : supported_isas()) {
    for (const uint32_t threads : {1u, 3u}) {
      const Result<std::unique_ptr<Renderer>> renderer =
          Renderer::create({.threads = threads, .allow_oversubscription = true, .isa = isa});
      ASSERT_TRUE(renderer.ok()) << renderer.status().message();
      const FrameAvatar seen[] = {{.avatar = add(**renderer, knowing_.avatar),
                                   .pose = outside.view(),
                                   .keep_to_known = true}};
      EXPECT_EQ(tests::render(**renderer, {.camera = camera_, .avatars = seen}).rgba, truth)
          << to_string(isa) << ", " << threads;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Precisions, KeepToKnown,
                         ::testing::Values(tests::Held::kFloat32, tests::Held::kFixedPoint),
                         [](const auto& tested) {
                           return tested.param == tests::Held::kFloat32 ? "Float" : "FixedPoint";
                         });

}  // namespace
}  // namespace figurine::keep_to_known_test
