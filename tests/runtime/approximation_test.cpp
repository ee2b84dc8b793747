// What a frame may leave out although it shows: nothing unless asked for, and then what it says.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "runtime/splat_scene.h"
#include "runtime/src/pose/output_line.h"
#include "runtime/test_packages.h"

namespace figurine::approximation_test {
namespace {

using tests::SyntheticAvatar;
using tests::SyntheticBody;
using tests::SyntheticPose;

constexpr uint32_t kImageSize = 96;

class Approximations : public ::testing::TestWithParam<tests::Held> {
 protected:
  // A fresh renderer, with the avatar and a coarse one of fewer texels.
  Approximations() {
    avatar_id_ = add(*avatar_.package, *body_.package);
    coarse_id_ = add(*coarse_.package, *coarse_body_.package);
  }
  AvatarId add(const Package& avatar, const Package& body) {
    const Result<AvatarId> id = renderer_->add_avatar(avatar, body);
    FIG_CHECK(id.ok(), id.status().message().c_str());
    return *id;
  }
  SyntheticPose pose(uint32_t frame) const { return tests::make_test_pose(body_.body(), frame); }

  std::vector<float> draw(const std::vector<FrameAvatar>& seen,
                          const Approximation& approximation = {}) {
    Frame frame{.camera = camera_, .avatars = seen};
    frame.leave_out.unchanged_networks = false;
    frame.approximation = approximation;
    return tests::render(*renderer_, frame).rgba;
  }
  std::vector<float> draw(const SyntheticPose& pose, const Approximation& approximation = {}) {
    return draw({{.avatar = avatar_id_, .pose = pose.view()}}, approximation);
  }
  const FrameStatistics& statistics() const { return renderer_->statistics(); }

  SyntheticBody body_ = tests::make_test_body({.uv_size = 32, .joints = 5});
  SyntheticBody coarse_body_ = tests::make_test_body({.uv_size = 16, .joints = 5});
  SyntheticAvatar avatar_ = tests::make_test_avatar(
      body_, {.channels = 8, .sh_degree = 1, .held = GetParam(), .network_step = 2});
  SyntheticAvatar coarse_ = tests::make_test_avatar(
      coarse_body_, {.channels = 4, .held = GetParam(), .network_step = 2, .static_part = true});
  std::unique_ptr<Renderer> renderer_ = tests::make_renderer();
  Camera camera_ = tests::make_test_camera(kImageSize, kImageSize);
  AvatarId avatar_id_{}, coarse_id_{};
};

TEST_P(Approximations, ANetworkThatRunsNowAndThenHasAStillFigureAsItIs) {
  const SyntheticPose still = pose(2);
  const std::vector<float> truth = draw(still);
  uint64_t networks = 0;
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(draw(still, {.network_interval = 4}), truth) << "frame " << i;
    networks += statistics().networks;
    EXPECT_EQ(statistics().networks + statistics().stale_networks, 1u);
  }
  EXPECT_EQ(networks, 2u);
  EXPECT_EQ(draw(still), truth);
  EXPECT_EQ(statistics().networks, 1u) << "what goes on is not taken for the last run";
}

TEST_P(Approximations, OutputsGoOnBetweenTheRunsOfAMovingFigure) {
  const SyntheticPose a = pose(1), b = pose(3);
  const std::vector<float> of_a = draw(a), of_b = draw(b);
  const Approximation every_other{.network_interval = 2};
  ASSERT_EQ(draw(a, every_other), of_a);
  ASSERT_EQ(statistics().networks, 1u);
  const std::vector<float> stale = draw(b, every_other);
  ASSERT_EQ(statistics().stale_networks, 1u);
  EXPECT_NE(stale, of_b) << "there is no line yet: what the network said of the other pose";
  EXPECT_EQ(draw(b, every_other), of_b) << "a run's own pose is exact";
  ASSERT_EQ(statistics().networks, 1u);
  const std::vector<float> on = draw(b, every_other);
  ASSERT_EQ(statistics().stale_networks, 1u);
  EXPECT_NE(on, of_b) << "from the one pose to the other, and half as far again";
  EXPECT_NE(on, stale);
  // Back at every pose, nothing of it is left.
  EXPECT_EQ(draw(a), of_a);
  EXPECT_EQ(statistics().networks, 1u);
}

TEST_P(Approximations, AvatarsTakeTurnsAndEqualOnesAllRun) {
  SyntheticAvatar other = tests::make_test_avatar(
      body_, {.channels = 8, .seed = 5, .held = GetParam(), .network_step = 2});
  const AvatarId second = add(*other.package, *body_.package),
                 equal = add(*other.package, *body_.package);
  const Approximation interval{.network_interval = 3};
  std::vector<uint64_t> networks;
  for (uint32_t i = 0; i < 7; ++i) {
    const SyntheticPose now = pose(i);
    draw({{.avatar = avatar_id_, .pose = now.view()}, {.avatar = second, .pose = now.view()}},
         interval);
    networks.push_back(statistics().networks);
  }
  EXPECT_EQ(networks[0], 2u);
  for (size_t i = 1; i < networks.size(); ++i) EXPECT_LE(networks[i], 1u) << "frame " << i;
  for (uint32_t i = 0; i < 3; ++i) {
    const SyntheticPose now = pose(i), then = pose(i + 1);
    const std::vector<FrameAvatar> both = {{.avatar = second, .pose = now.view()},
                                           {.avatar = equal, .pose = then.view()}};
    const std::vector<float> truth = draw(both);
    EXPECT_EQ(draw(both, interval), truth);
    EXPECT_EQ(statistics().networks, 2u) << "of avatars that are held once nobody profits";
  }
}

TEST_P(Approximations, WhatFacesAwayMayBeLeftOut) {
  // A block of sixteen texels is an eighth of this cylinder's circumference: some go whole.
  const SyntheticBody round = tests::make_test_body({.uv_size = 128, .joints = 5});
  const SyntheticAvatar of_round =
      tests::make_test_avatar(round, {.held = GetParam(), .network_step = 4, .static_part = true});
  const AvatarId id = add(*of_round.package, *round.package);
  const SyntheticPose now = tests::make_test_pose(round.body(), 2);
  const std::vector<FrameAvatar> seen = {{.avatar = id, .pose = now.view()}};
  const std::vector<float> truth = draw(seen);
  ASSERT_EQ(draw(seen, {.averted_above = 1}), truth);
  EXPECT_EQ(statistics().averted_texels, 0u);
  const uint64_t all = statistics().gaussians, visible = statistics().visible;
  uint64_t fewer = 0;
  for (const float cosine : {0.7f, 0.3f, 0.0f}) {
    draw(seen, {.averted_above = cosine});
    EXPECT_GT(statistics().averted_texels, fewer) << cosine;
    EXPECT_LT(statistics().visible, visible) << cosine;
    EXPECT_GE(statistics().visible + statistics().averted_texels, visible) << cosine;
    fewer = statistics().averted_texels;
  }
  EXPECT_NEAR(static_cast<double>(fewer) / static_cast<double>(all), 0.5, 0.05)
      << "the half of a cylinder that faces the camera stays";
  EXPECT_LT(statistics().gaussians, all);
  EXPECT_EQ(draw(seen), truth);
}

TEST_P(Approximations, BandsOfSphericalHarmonicsMayBeLeftOut) {
  const SyntheticPose now = pose(2);
  const std::vector<float> truth = draw(now);
  EXPECT_EQ(draw(now, {.sh_degree = 1}), truth);
  EXPECT_NE(draw(now, {.sh_degree = 0}), truth);

  const tests::Scene whole = tests::make_random_scene(300, 3, 7);
  tests::Scene constant = whole;
  constant.sh_degree = 0;
  constant.sh.clear();
  for (size_t i = 0; i < whole.opacity.size(); ++i)
    constant.sh.insert(constant.sh.end(), &whole.sh[48 * i], &whole.sh[48 * i] + 3);
  const auto draw_cloud = [&](const tests::Scene& scene, uint32_t degree) {
    const GaussianView view = scene.view();
    Frame frame{.camera = tests::front_camera(64, 64, 60), .gaussians = {&view, 1}};
    frame.approximation.sh_degree = degree;
    return tests::render(*renderer_, frame).rgba;
  };
  EXPECT_EQ(draw_cloud(whole, 0), draw_cloud(constant, 3));
  EXPECT_NE(draw_cloud(whole, 0), draw_cloud(whole, 3));
}

TEST_P(Approximations, SmallFiguresAreDrawnByTheirCoarseAvatar) {
  const SyntheticPose now = pose(2);
  const std::vector<FrameAvatar> seen = {
      {.avatar = avatar_id_, .pose = now.view(), .coarse = coarse_id_}};
  const std::vector<float> fine = draw(now),
                           coarse = draw({{.avatar = coarse_id_, .pose = now.view()}});
  ASSERT_NE(fine, coarse);
  EXPECT_EQ(draw(seen), fine) << "unless asked for, never";
  EXPECT_EQ(draw(seen, {.coarse_below_px = 20}), fine) << "the figure is larger";
  EXPECT_EQ(statistics().coarse_avatars, 0u);
  EXPECT_EQ(draw(seen, {.coarse_below_px = kImageSize}), coarse);
  EXPECT_EQ(statistics().coarse_avatars, 1u);
  EXPECT_EQ(draw(now, {.coarse_below_px = kImageSize}), fine) << "there is no other";
  camera_.fx_px *= 8, camera_.fy_px *= 8;
  draw(seen, {.coarse_below_px = kImageSize});
  EXPECT_EQ(statistics().coarse_avatars, 0u) << "it is near";
}

TEST_P(Approximations, WhatMakesNoSenseIsRefusedByName) {
  const SyntheticPose now = pose(1);
  std::vector<float> pixels(size_t{4} * kImageSize * kImageSize);
  const auto message = [&](const FrameAvatar& seen, const Approximation& approximation) {
    Frame frame{.camera = camera_, .avatars = {&seen, 1}};
    frame.approximation = approximation;
    const Status status = renderer_->render(frame, {.pixels = pixels.data(),
                                                    .stride_bytes = size_t{16} * kImageSize,
                                                    .format = PixelFormat::kRgbaF32});
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    return status.message();
  };
  const FrameAvatar seen{.avatar = avatar_id_, .pose = now.view()};
  const auto names = [&](const Approximation& approximation, const char* name) {
    return message(seen, approximation).find(name) != std::string::npos;
  };
  EXPECT_TRUE(names({.network_interval = 0}, "network_interval"));
  for (const float odd : {-1.0f, NAN, INFINITY}) {
    EXPECT_TRUE(names({.network_below_px = odd}, "network_below_px")) << odd;
    EXPECT_TRUE(names({.coarse_below_px = odd}, "coarse_below_px")) << odd;
    EXPECT_TRUE(names({.averted_above = odd}, "averted_above")) << odd;
  }
  EXPECT_TRUE(names({.averted_above = 1.5f}, "averted_above"));
  EXPECT_TRUE(names({.sh_degree = 4}, "sh_degree"));

  FrameAvatar odd = seen;
  odd.coarse = AvatarId(77);
  EXPECT_NE(message(odd, {}).find("coarse: there is no avatar"), std::string::npos);
  SyntheticBody four = tests::make_test_body({.uv_size = 16, .joints = 4});
  SyntheticAvatar of_four = tests::make_test_avatar(four, {.held = GetParam()});
  odd.coarse = add(*of_four.package, *four.package);
  EXPECT_NE(message(odd, {}).find("coarse"), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Precisions, Approximations,
                         ::testing::Values(tests::Held::kFloat32, tests::Held::kFixedPoint),
                         [](const auto& held) {
                           return held.param == tests::Held::kFloat32 ? "F32" : "Q8";
                         });

TEST(OutputLine, GoesOnFromTheLastOutputs) {
  OutputLine line;
  EXPECT_FALSE(line.begun());
  const std::vector<float> from = {0, 1, -2}, last = {4, 1, 2};
  ASSERT_TRUE(line.begin_at(from));
  ASSERT_TRUE(line.begun());
  const auto at = [&](float steps) {
    line.go_on(last, steps);
    return std::vector<float>(line.outputs(), line.outputs() + last.size());
  };
  EXPECT_EQ(at(0), last);
  EXPECT_EQ(at(0.25f), (std::vector<float>{5, 1, 3}));
  EXPECT_EQ(at(1), (std::vector<float>{8, 1, 6}));
  line.forget();
  EXPECT_FALSE(line.begun());
}

}  // namespace
}  // namespace figurine::approximation_test
