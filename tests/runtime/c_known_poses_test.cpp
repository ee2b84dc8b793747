// Known poses through figurine.h: how unusual one is, and avatars that keep to them.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "figurine.h"
#include "figurine/known_poses.h"
#include "runtime/test_packages.h"

namespace figurine::tests {
namespace {

constexpr uint32_t kSize = 48;

fig_package open_for_drawing(std::span<const std::byte> bytes) {
  fig_package_options options = fig_default_package_options();
  options.for_drawing = 1;
  fig_package package{};
  EXPECT_EQ(fig_package_open(bytes.data(), bytes.size(), &options, &package), FIG_OK)
      << fig_last_message();
  return package;
}

class CKnownPoses : public testing::Test {
 protected:
  void SetUp() override {
    body = open_for_drawing(test_body.bytes.bytes());
    ASSERT_EQ(fig_renderer_create(nullptr, &renderer), FIG_OK) << fig_last_message();
    pose.joint_count = test_body.body().joint_count();
    fig_orbit orbit = fig_default_orbit();
    orbit.distance_m = 3;
    orbit.target_m[1] = 0.5f;
    ASSERT_EQ(fig_make_orbit_camera(&orbit, kSize, kSize, &camera), FIG_OK) << fig_last_message();
  }
  void TearDown() override { EXPECT_EQ(fig_renderer_destroy(renderer), FIG_OK); }
  fig_avatar add(const SyntheticAvatar& avatar) {
    fig_avatar added{};
    EXPECT_EQ(fig_renderer_add_avatar(renderer, open_for_drawing(avatar.bytes.bytes()), 0, body,
                                      nullptr, &added),
              FIG_OK)
        << fig_last_message();
    return added;
  }
  fig_pose_rarity rarity_of(fig_avatar avatar) {
    fig_pose_rarity rarity = fig_default_pose_rarity();
    rarity.known = 7;
    EXPECT_EQ(fig_renderer_pose_rarity(renderer, avatar, &pose, &rarity), FIG_OK)
        << fig_last_message();
    return rarity;
  }
  void refused(fig_status status, const std::string& words) {
    EXPECT_EQ(status, FIG_INVALID_ARGUMENT);
    EXPECT_NE(std::string(fig_last_message()).find(words), std::string::npos) << fig_last_message();
  }

  const SyntheticBody test_body = make_test_body();
  const SyntheticPose bent = make_test_pose(test_body.body(), 3);
  fig_package body{};
  fig_renderer renderer{};
  fig_camera camera = fig_default_camera();
  fig_pose pose = [this] {
    fig_pose value = fig_default_pose();
    value.rotations = bent.rotations.data();
    return value;
  }();
};

TEST_F(CKnownPoses, SayHowUnusualOneIs) {
  const SyntheticAvatar silent = make_test_avatar(test_body),
                        knowing = make_test_avatar(test_body, {.known_poses = true});
  EXPECT_EQ(rarity_of(add(silent)).known, 0);
  EXPECT_EQ(rarity_of(add(silent)).distance, 0);
  const fig_avatar avatar = add(knowing);
  const KnownPoses known =
      std::move(KnownPoses::create(knowing.package->avatar().pose_statistics)).value();
  const fig_pose_rarity rarity = rarity_of(avatar);
  EXPECT_EQ(rarity.known, 1);
  EXPECT_EQ(rarity.distance, known.rarity(bent.rotations).distance);
  EXPECT_EQ(rarity.share_beyond, known.rarity(bent.rotations).share_beyond);

  fig_pose_rarity out = fig_default_pose_rarity();
  refused(fig_renderer_pose_rarity(renderer, avatar, nullptr, &out), "pose");
  refused(fig_renderer_pose_rarity(renderer, avatar, &pose, nullptr), "pose rarity");
  refused(fig_renderer_pose_rarity(renderer, {}, &pose, &out), "avatar");
  pose.joint_count = 2;
  refused(fig_renderer_pose_rarity(renderer, avatar, &pose, &out), "joints");
}

TEST_F(CKnownPoses, AreKeptToWhereThatIsAskedFor) {
  const SyntheticAvatar knowing = make_test_avatar(test_body, {.known_poses = true});
  fig_frame_avatar seen = fig_default_frame_avatar();
  seen.avatar = add(knowing);
  seen.pose = &pose;
  fig_frame frame = fig_default_frame();
  frame.camera = &camera;
  frame.avatars = &seen, frame.avatar_count = 1;
  std::vector<uint8_t> pixels(size_t{4} * kSize * kSize);
  fig_image image = fig_default_image();
  image.pixels = pixels.data();
  image.stride_bytes = size_t{4} * kSize;
  const auto pulled_poses = [&] {
    EXPECT_EQ(fig_renderer_render(renderer, &frame, &image), FIG_OK) << fig_last_message();
    fig_statistics statistics = fig_default_statistics();
    EXPECT_EQ(fig_renderer_statistics(renderer, &statistics), FIG_OK) << fig_last_message();
    return statistics.pulled_poses;
  };
  EXPECT_EQ(pulled_poses(), 0u);
  const std::vector<uint8_t> before = pixels;
  seen.keep_to_known = 1;
  EXPECT_EQ(pulled_poses(), 1u);
  EXPECT_NE(pixels, before);
  seen.keep_to_known = 2;
  refused(fig_renderer_render(renderer, &frame, &image), "keep_to_known: neither 0 nor 1");
}

}  // namespace
}  // namespace figurine::tests
