// Avatars in fixed point through the renderer: which precision runs, what is refused, and frames
// that are the same bytes everywhere.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::precision_test {
namespace {

using tests::Held;
using tests::make_renderer;
using tests::make_test_avatar;
using tests::make_test_body;
using tests::make_test_camera;
using tests::make_test_pose;
using tests::SyntheticAvatar;
using tests::SyntheticBody;
using tests::SyntheticPose;

struct Drawn {
  Precision precision = Precision::kFloat32;
  std::vector<uint8_t> rgba;
};

Drawn draw(const SyntheticBody& body, const SyntheticAvatar& avatar, uint32_t frame,
           std::optional<Precision> precision, uint32_t threads = 1) {
  const std::unique_ptr<Renderer> renderer = make_renderer(threads);
  const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body.package, precision);
  FIG_CHECK(id.ok(), id.status().message().c_str());
  const SyntheticPose pose = make_test_pose(body.body(), frame);
  const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
  Drawn drawn{.precision = renderer->precision(*id),
              .rgba = std::vector<uint8_t>(200 * 150 * 4, 77)};
  const Status status = renderer->render({.camera = make_test_camera(200, 150),
                                          .avatars = seen,
                                          .background = std::array{0.5f, 0.5f, 0.5f}},
                                         {.pixels = drawn.rgba.data(), .stride_bytes = 800});
  EXPECT_TRUE(status.ok()) << status.message();
  return drawn;
}

// FNV-1a, 64 bits.
uint64_t hash(const std::vector<uint8_t>& bytes) {
  uint64_t value = 0xcbf29ce484222325u;
  for (const uint8_t byte : bytes) value = (value ^ byte) * 0x100000001b3u;
  return value;
}

double psnr_db(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (int{a[i]} - int{b[i]}) * (int{a[i]} - int{b[i]});
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.size()) / sum);
}

TEST(PrecisionOfARenderer, IsFixedPointWhereTheAvatarHasIt) {
  const SyntheticBody body = make_test_body();
  EXPECT_EQ(draw(body, make_test_avatar(body, {.held = Held::kFloat32}), 1, {}).precision,
            Precision::kFloat32);
  EXPECT_EQ(draw(body, make_test_avatar(body, {.held = Held::kFixedPoint}), 1, {}).precision,
            Precision::kFixedPoint);
  const SyntheticAvatar both = make_test_avatar(body, {.held = Held::kBoth});
  EXPECT_EQ(draw(body, both, 1, {}).precision, Precision::kFixedPoint);
  EXPECT_EQ(draw(body, both, 1, Precision::kFloat32).precision, Precision::kFloat32);
  EXPECT_EQ(draw(body, both, 1, Precision::kFixedPoint).precision, Precision::kFixedPoint);
}

TEST(PrecisionOfARenderer, IsRefusedWhereTheAvatarLacksIt) {
  const SyntheticBody body = make_test_body();
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const SyntheticAvatar floats = make_test_avatar(body),
                        fixed = make_test_avatar(body, {.held = Held::kFixedPoint});
  const Status no_fixed =
      renderer->add_avatar(*floats.package, *body.package, Precision::kFixedPoint).status();
  EXPECT_EQ(no_fixed.code(), StatusCode::kUnsupported);
  EXPECT_NE(no_fixed.message().find("figurine-train pack --precision q8"), std::string::npos)
      << no_fixed.message();
  const Status no_float =
      renderer->add_avatar(*fixed.package, *body.package, Precision::kFloat32).status();
  EXPECT_EQ(no_float.code(), StatusCode::kUnsupported);
  EXPECT_NE(no_float.message().find("in q8 alone, not in f32"), std::string::npos)
      << no_float.message();
  EXPECT_EQ(no_float.message().find('\n'), std::string::npos);
}

TEST(PrecisionOfARenderer, BothPrecisionsOfOneAvatarMayStandInAFrame) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body, {.held = Held::kBoth});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> fixed = renderer->add_avatar(*avatar.package, *body.package,
                                                      Precision::kFixedPoint),
                         floats = renderer->add_avatar(*avatar.package, *body.package,
                                                       Precision::kFloat32);
  ASSERT_TRUE(fixed.ok() && floats.ok());
  const SyntheticPose pose = make_test_pose(body.body(), 2);
  std::vector<std::vector<float>> positions;
  for (const AvatarId id : {*fixed, *floats, *fixed}) {
    const Result<GaussianView> posed = renderer->pose_avatar(id, pose.view());
    ASSERT_TRUE(posed.ok());
    positions.emplace_back(posed->position_m.begin(), posed->position_m.end());
  }
  EXPECT_EQ(positions[0], positions[2]);
  EXPECT_NE(positions[0], positions[1]);
}

TEST(FixedPointFrame, IsCloseToTheFloatFrame) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar avatar = make_test_avatar(body, {.channels = 8, .held = Held::kBoth});
  for (const uint32_t frame : {1u, 3u}) {
    const double psnr = psnr_db(draw(body, avatar, frame, Precision::kFixedPoint).rgba,
                                draw(body, avatar, frame, Precision::kFloat32).rgba);
    std::printf("frame %u: %.1f dB to the float frame\n", frame, psnr);
    EXPECT_GT(psnr, 50) << "a random network, calibrated by the range of one pose";
  }
}

TEST(FixedPointFrame, TheSameBytesForAnyNumberOfThreads) {
  const SyntheticBody body = make_test_body({.uv_size = 64, .joints = 5});
  const SyntheticAvatar avatar =
      make_test_avatar(body, {.channels = 16, .fourier_octaves = 5, .held = Held::kFixedPoint});
  const std::vector<uint8_t> one = draw(body, avatar, 3, {}, 1).rgba;
  for (const uint32_t threads : {2u, 3u})
    EXPECT_TRUE(draw(body, avatar, 3, {}, threads).rgba == one) << threads << " threads";
}

TEST(FixedPointFrame, TheSameBytesOnEveryCpu) {
  // Measured once; a CPU, a compiler or a version of XNNPACK that gives another number breaks the
  // promise of golden hashes.
  const SyntheticBody body = make_test_body({.uv_size = 32, .joints = 5});
  const SyntheticAvatar avatar =
      make_test_avatar(body, {.channels = 8, .fourier_octaves = 3, .held = Held::kFixedPoint});
  EXPECT_EQ(hash(draw(body, avatar, 3, {}).rgba), 11694599759566206101u) << network_library();
}

TEST(FixedPointFrame, DoesNotRememberEarlierOnes) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body, {.held = Held::kFixedPoint});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body.package);
  ASSERT_TRUE(id.ok());
  std::vector<std::vector<float>> positions;
  for (const uint32_t frame : {1u, 2u, 4u, 1u}) {
    const SyntheticPose pose = make_test_pose(body.body(), frame);
    const Result<GaussianView> posed = renderer->pose_avatar(*id, pose.view());
    ASSERT_TRUE(posed.ok());
    positions.emplace_back(posed->position_m.begin(), posed->position_m.end());
  }
  EXPECT_EQ(positions[0], positions[3]);
  EXPECT_NE(positions[0], positions[1]);
}

}  // namespace
}  // namespace figurine::precision_test
