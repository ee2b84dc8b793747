// Leaving out is exact: every switch changes what is computed and none changes a pixel; and
// instruction sets and threads do not either.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "formats/writer/package_writer.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::leave_out_test {
namespace {

using tests::SyntheticBody;
using tests::SyntheticPose;

// A test avatar whose offsets have a bound, as no package of version 0.1 has.
struct BoundedAvatar {
  tests::SyntheticAvatar unbounded;
  Avatar avatar;
};

BoundedAvatar make_bounded_avatar(const SyntheticBody& body, tests::Held held) {
  BoundedAvatar bounded{.unbounded = tests::make_test_avatar(body, {.channels = 8, .held = held}),
                        .avatar = {}};
  bounded.avatar = bounded.unbounded.package->avatar();
  bounded.avatar.decoding.max_offset = 1;
  bounded.avatar.decoding.max_log_scale = 0.5f;
  return bounded;
}

class LeaveOutScene : public ::testing::TestWithParam<tests::Held> {
 protected:
  // Close up, so that part of the body is outside; opaque and faint Gaussians in front of it.
  LeaveOutScene() {
    camera_ = *make_orbit_camera({.distance_m = 0.8f, .target_m = {0.1f, 0.1f, 0}}, 150, 110);
    tests::Random random(5);
    for (int i = 0; i < 600; ++i) {
      cloud_.add_ball({random.uniform(-1, 1), random.uniform(0, 2), random.uniform(-0.5f, 0.5f)},
                      random.uniform(0.002f, 0.1f), random.uniform(0, 1) < 0.2f ? 0.003f : 0.9f,
                      {random.uniform(0, 1), 0.5f, 0.25f});
    }
  }

  struct Drawn {
    std::vector<float> rgba;
    FrameStatistics statistics;
  };
  Drawn draw(const LeaveOut& leave_out, uint32_t threads = 1,
             std::optional<Isa> isa = std::nullopt) {
    Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = threads, .isa = isa});
    FIG_CHECK(renderer.ok(), renderer.status().message().c_str());
    const Result<AvatarId> id = (*renderer)->add_avatar(avatar_.avatar, *body_.package);
    FIG_CHECK(id.ok(), id.status().message().c_str());
    const FrameAvatar seen[] = {{.avatar = *id, .pose = pose_.view()}};
    const GaussianView cloud = cloud_.view();
    Drawn drawn{.rgba = tests::render(**renderer, {.camera = camera_,
                                                   .avatars = seen,
                                                   .gaussians = {&cloud, 1},
                                                   .background = std::nullopt,
                                                   .splat = {},
                                                   .leave_out = leave_out})
                            .rgba,
                .statistics = (*renderer)->statistics()};
    return drawn;
  }

  SyntheticBody body_ = tests::make_test_body({.uv_size = 32, .joints = 5});
  BoundedAvatar avatar_ = make_bounded_avatar(body_, GetParam());
  SyntheticPose pose_ = tests::make_test_pose(body_.body(), 2);
  tests::Scene cloud_;
  Camera camera_;
};

constexpr LeaveOut kNothing{.hidden_texels = false,
                            .transparent = false,
                            .outside = false,
                            .missed_tiles = false,
                            .stopped = false,
                            .unchanged_networks = false};

TEST_P(LeaveOutScene, EverySwitchIsExactAndCounted) {
  const Drawn all = draw({}), none = draw(kNothing);
  ASSERT_EQ(all.rgba, none.rgba);
  const FrameStatistics::LeftOut& left_out = all.statistics.left_out;
  EXPECT_GT(left_out.hidden_texels, 0u);
  EXPECT_GT(left_out.transparent, 0u);
  EXPECT_GT(left_out.outside, 0u);
  EXPECT_GT(left_out.missed_tiles, 0u);
  EXPECT_GT(left_out.stopped, 0u);
  EXPECT_EQ(none.statistics.left_out.hidden_texels, 0u);
  EXPECT_EQ(none.statistics.left_out.transparent, 0u);
  EXPECT_EQ(none.statistics.left_out.outside, 0u);
  EXPECT_EQ(none.statistics.left_out.missed_tiles, 0u);
  EXPECT_EQ(none.statistics.left_out.stopped, 0u);
  EXPECT_EQ(all.statistics.blends, none.statistics.blends)
      << "contributions that count are the same";
  EXPECT_LT(all.statistics.visible, none.statistics.visible);
  EXPECT_LT(all.statistics.pairs, none.statistics.pairs);
  EXPECT_EQ(all.statistics.gaussians + left_out.hidden_texels, none.statistics.gaussians);
}

TEST_P(LeaveOutScene, EachSwitchAloneIsExact) {
  const std::vector<float> truth = draw(kNothing).rgba;
  for (const auto member : {&LeaveOut::hidden_texels, &LeaveOut::transparent, &LeaveOut::outside,
                            &LeaveOut::missed_tiles, &LeaveOut::stopped}) {
    LeaveOut one = kNothing;
    one.*member = true;
    ASSERT_EQ(draw(one).rgba, truth);
  }
}

TEST_P(LeaveOutScene, EachSwitchIsExactWithFiltersToo) {
  std::vector<uint8_t> extents;  // up to 5 mm
  for (uint32_t i = 0; i < body_.body().texel_count(); ++i)
    extents.push_back(static_cast<uint8_t>(i * 91 % 256));
  avatar_.avatar.smallest_extents = {.scale_m = 2e-5f, .codes = extents};
  avatar_.avatar.antialiased = true;
  const Drawn none = draw(kNothing), all = draw({});
  ASSERT_EQ(all.rgba, none.rgba);
  EXPECT_GT(all.statistics.left_out.hidden_texels, 0u);
  EXPECT_GT(all.statistics.left_out.transparent, 0u);
  for (const auto member : {&LeaveOut::hidden_texels, &LeaveOut::transparent, &LeaveOut::outside}) {
    LeaveOut one = kNothing;
    one.*member = true;
    ASSERT_EQ(draw(one).rgba, none.rgba);
  }
}

TEST_P(LeaveOutScene, ANetworkDoesNotRunForThePoseOfItsLastRun) {
  const std::unique_ptr<Renderer> renderer = tests::make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(avatar_.avatar, *body_.package);
  ASSERT_TRUE(id.ok());
  const FrameAvatar twice[] = {{.avatar = *id, .pose = pose_.view()},
                               {.avatar = *id, .pose = pose_.view()}};
  const auto draw_twice = [&](const LeaveOut& leave_out) {
    Frame frame{.camera = camera_, .avatars = twice};
    frame.leave_out = leave_out;
    return tests::render(*renderer, frame).rgba;
  };
  const std::vector<float> first = draw_twice({});
  const FrameStatistics of_first = renderer->statistics();
  EXPECT_EQ(of_first.networks, 1u);
  EXPECT_EQ(of_first.left_out.unchanged_networks, 1u);
  EXPECT_GT(of_first.macs, 0u);
  EXPECT_EQ(draw_twice({}), first);
  EXPECT_EQ(renderer->statistics().networks, 0u);
  EXPECT_EQ(renderer->statistics().left_out.unchanged_networks, 2u);
  EXPECT_EQ(renderer->statistics().macs, 0u);
  EXPECT_EQ(draw_twice({.unchanged_networks = false}), first);
  EXPECT_EQ(renderer->statistics().networks, 2u);
  EXPECT_EQ(renderer->statistics().macs, 2 * of_first.macs);
}

TEST_P(LeaveOutScene, SmallFiguresMayKeepWhatTheirNetworkSaid) {
  const std::unique_ptr<Renderer> renderer = tests::make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(avatar_.avatar, *body_.package);
  ASSERT_TRUE(id.ok());
  const SyntheticPose other = tests::make_test_pose(body_.body(), 4);
  const auto draw_pose = [&](const SyntheticPose& pose, float below_px) {
    const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
    Frame frame{.camera = tests::make_test_camera(64, 64), .avatars = seen};
    frame.approximation.network_below_px = below_px;
    return tests::render(*renderer, frame).rgba;
  };
  const std::vector<float> truth = draw_pose(other, 0);
  draw_pose(pose_, 0);
  EXPECT_EQ(draw_pose(other, 10), truth) << "the figure is larger";
  EXPECT_EQ(renderer->statistics().stale_networks, 0u);
  draw_pose(pose_, 0);
  EXPECT_NE(draw_pose(other, 200), truth);
  EXPECT_EQ(renderer->statistics().stale_networks, 1u);
  EXPECT_EQ(renderer->statistics().networks, 0u);
  EXPECT_EQ(draw_pose(other, 0), truth);

  Frame frame{.camera = camera_};
  std::vector<uint8_t> pixels(size_t{4} * camera_.width_px * camera_.height_px);
  for (const float below_px : {-1.0f, NAN, INFINITY}) {
    frame.approximation.network_below_px = below_px;
    const Status refused = renderer->render(
        frame, {.pixels = pixels.data(), .stride_bytes = size_t{4} * camera_.width_px});
    EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(refused.message().find("network_below_px"), std::string::npos);
  }
}

TEST_P(LeaveOutScene, TheFastBlendIsNearTheExactOne) {
  const GaussianView cloud = cloud_.view();
  for (const Isa isa : supported_isas()) {
    const std::unique_ptr<Renderer> renderer =
        std::move(Renderer::create({.threads = 1, .isa = isa})).value();
    const auto draw_blend = [&](bool fast) {
      Frame frame{.camera = camera_, .gaussians = {&cloud, 1}};
      frame.approximation.fast_blend = fast;
      return tests::render(*renderer, frame).rgba;
    };
    const std::vector<float> exact = draw_blend(false), fast = draw_blend(true);
    EXPECT_EQ(fast == exact, isa == Isa::kBaseline) << to_string(isa);
    double squares = 0;
    for (size_t i = 0; i < exact.size(); i += 4) {  // premultiplied red
      const double difference = double(exact[i] * exact[i + 3]) - double(fast[i] * fast[i + 3]);
      squares += difference * difference;
    }
    EXPECT_LE(squares, 1e-5 * static_cast<double>(exact.size() / 4)) << to_string(isa);
    EXPECT_EQ(draw_blend(false), exact);
  }
}

TEST_P(LeaveOutScene, AnyThreadsAndInstructionSetGiveTheSamePicture) {
  const Drawn truth = draw({}, 1, Isa::kBaseline);
  for (const Isa isa : supported_isas()) {
    for (const uint32_t threads : {1u, 2u, 3u}) {
      const Drawn other = draw({}, threads, isa);
      ASSERT_EQ(other.rgba, truth.rgba) << to_string(isa) << ", " << threads << " threads";
      EXPECT_EQ(other.statistics.blends, truth.statistics.blends);
      EXPECT_EQ(other.statistics.left_out.stopped, truth.statistics.left_out.stopped);
    }
  }
}

TEST_P(LeaveOutScene, AnAvatarBehindTheCameraCostsNoNetwork) {
  camera_ = *make_orbit_camera({.distance_m = 3, .target_m = {0, 0.9f, 6}}, 64, 64);
  camera_.view_from_world[11] -= 20;  // the body is now well behind
  const Drawn drawn = draw({});
  EXPECT_EQ(drawn.statistics.macs, 0u);
  EXPECT_EQ(drawn.statistics.left_out.hidden_texels, body_.body().texel_count());
  EXPECT_EQ(drawn.rgba, draw(kNothing).rgba);
}

INSTANTIATE_TEST_SUITE_P(Precisions, LeaveOutScene,
                         ::testing::Values(tests::Held::kFloat32, tests::Held::kFixedPoint),
                         [](const auto& of) {
                           return of.param == tests::Held::kFloat32 ? "f32" : "q8";
                         });

TEST(RendererIsa, IsWhatWasAskedForOrRefused) {
  const auto renderer = Renderer::create({.isa = Isa::kBaseline});
  ASSERT_TRUE(renderer.ok());
  EXPECT_EQ((*renderer)->isa(), Isa::kBaseline);
  EXPECT_EQ((*Renderer::create({}))->isa(), supported_isas().back());
#if defined(__x86_64__)
  const auto refused = Renderer::create({.isa = Isa::kNeon});
#else
  const auto refused = Renderer::create({.isa = Isa::kAvx2});
#endif
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.status().code(), StatusCode::kUnsupported);
}

}  // namespace
}  // namespace figurine::leave_out_test
