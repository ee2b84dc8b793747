// The renderer from the outside: avatars and static Gaussians in one frame, formats, backgrounds,
// errors, and the same pixels for any number of threads.
#include "figurine/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "largest_error.h"
#include "oracle/splat_oracle.h"
#include "runtime/nn/reference_network.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::renderer_test {
namespace {

using tests::FloatImage;
using tests::Held;
using tests::make_renderer;
using tests::make_test_avatar;
using tests::make_test_body;
using tests::make_test_camera;
using tests::make_test_pose;
using tests::Scene;
using tests::SyntheticAvatar;
using tests::SyntheticBody;
using tests::SyntheticPose;

std::vector<uint8_t> render_bytes(Renderer& renderer, const Frame& frame) {
  std::vector<uint8_t> rgba(size_t(frame.camera.width_px) * frame.camera.height_px * 4, 77);
  const Status status = renderer.render(frame, {.pixels = rgba.data(),
                                                .stride_bytes = size_t(4) * frame.camera.width_px,
                                                .format = PixelFormat::kRgba8});
  EXPECT_TRUE(status.ok()) << status.message();
  return rgba;
}

AvatarId add(Renderer& renderer, const SyntheticAvatar& avatar, const SyntheticBody& body,
             std::optional<Precision> precision = {}) {
  const Result<AvatarId> id = renderer.add_avatar(*avatar.package, *body.package, precision);
  FIG_CHECK(id.ok(), id.status().message().c_str());
  return *id;
}

// The network's result by its definition, in the precision that the avatar holds.
std::vector<double> reference_head(const Avatar& avatar, const std::vector<float>& maps) {
  if (avatar.holds(Precision::kFloat32)) {
    return tests::run_reference<double>(avatar.network, *infer_shapes(avatar.network, true),
                                        {maps.begin(), maps.end()});
  }
  std::vector<int16_t> quantised;
  for (const float value : maps)
    quantised.push_back(quantise_input(value, avatar.fixed_point.values[0].scale));
  const std::vector<float> result =
      evaluate_fixed_point(avatar.network, avatar.fixed_point, quantised).result;
  return {result.begin(), result.end()};
}

// The Gaussians of an avatar by the definitions of figurine/avatar.h and body.h, everything after
// the shared pose arithmetic in double.
oracle::Gaussians reference_gaussians(const Avatar& avatar, const Body& body,
                                      const PoseView& pose) {
  const uint32_t stride = kMapChannels + 4 * avatar.fourier_octaves;
  std::vector<float> maps(size_t(body.uv_size) * body.uv_size * stride);
  std::vector<Affine> transforms(body.joint_count());
  draw_pose_maps(body, pose, avatar.map_statistics, transforms, stride, maps);
  draw_fourier_channels(body.uv_size, avatar.fourier_octaves, kMapChannels, stride, maps);
  const std::vector<double> head = reference_head(avatar, maps);

  std::vector<float> joints(body.joint_position_m.size()), texels(body.texel_position_m.size());
  shape_body(
      body, avatar.template_mode == TemplateMode::kShaped ? avatar.shape : std::span<const float>(),
      joints, texels);
  skinning_transforms({body.parents, joints}, pose, transforms);

  const HeadDecoding& decoding = avatar.decoding;
  oracle::Gaussians gaussians{.count = body.texel_count(), .sh_degree = decoding.sh_degree};
  for (size_t i = 0; i < body.texel_count(); ++i) {
    const double* h = &head[size_t(body.texel[i]) * head_channels(decoding.sh_degree)];
    double canonical[3], scale[3];
    for (int k = 0; k < 3; ++k) {
      canonical[k] = texels[3 * i + k] + decoding.offset_scale_m * h[k];
      scale[k] = double(decoding.spacing_scale) * body.texel_spacing_m[i] *
                 std::exp(std::clamp(h[3 + k], -double(decoding.max_log_scale),
                                     double(decoding.max_log_scale)));
    }
    const double length =
        std::sqrt((1 + h[6]) * (1 + h[6]) + h[7] * h[7] + h[8] * h[8] + h[9] * h[9]);
    const double w = (1 + h[6]) / length, x = h[7] / length, y = h[8] / length, z = h[9] / length;
    const double rotation[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    double blended[12] = {};
    for (uint32_t k = 0; k < kSkinInfluences; ++k) {
      const float weight = body.texel_weights[i * kSkinInfluences + k];
      for (int e = 0; e < 12; ++e)
        blended[e] += double(weight) * transforms[body.texel_joints[i * kSkinInfluences + k]].m[e];
    }
    for (int r = 0; r < 3; ++r) {
      double position = blended[4 * r + 3];
      for (int k = 0; k < 3; ++k) position += blended[4 * r + k] * canonical[k];
      gaussians.position_m.push_back(position);
      for (int c = 0; c < 3; ++c) {
        double value = 0;
        for (int k = 0; k < 3; ++k) value += blended[4 * r + k] * rotation[3 * k + c] * scale[c];
        gaussians.covariance_factor.push_back(value);
      }
    }
    gaussians.opacity.push_back(1 / (1 + std::exp(-(h[10] + decoding.opacity_bias))));
    gaussians.sh.insert(gaussians.sh.end(), h + 11, h + head_channels(decoding.sh_degree));
  }
  return gaussians;
}

TEST(Renderer, PosedGaussiansFollowTheDefinitions) {
  const std::pair<TemplateMode, Held> kinds[] = {{TemplateMode::kMean, Held::kFloat32},
                                                 {TemplateMode::kShaped, Held::kFloat32},
                                                 {TemplateMode::kShaped, Held::kFixedPoint}};
  for (const auto& [mode, held] : kinds) {
    const SyntheticBody body = make_test_body({.uv_size = 32, .joints = 5});
    const SyntheticAvatar avatar = make_test_avatar(
        body, {.channels = 8, .sh_degree = 1, .template_mode = mode, .held = held});
    const std::unique_ptr<Renderer> renderer = make_renderer();
    const AvatarId id = add(*renderer, avatar, body);
    LargestError position("positions, metres"), factor("covariance factors, metres"),
        opacity("opacities"), sh("SH coefficients");
    for (uint32_t frame : {0u, 3u}) {
      const SyntheticPose pose = make_test_pose(body.body(), frame);
      const Result<GaussianView> posed = renderer->pose_avatar(id, pose.view());
      ASSERT_TRUE(posed.ok());
      const oracle::Gaussians truth =
          reference_gaussians(avatar.package->avatar(), body.body(), pose.view());
      ASSERT_EQ(posed->count, truth.count);
      ASSERT_EQ(posed->sh_degree, 1u);
      ASSERT_EQ(posed->sh.size(), truth.sh.size());
      for (size_t i = 0; i < truth.position_m.size(); ++i)
        position.add(posed->position_m[i], truth.position_m[i]);
      for (size_t i = 0; i < truth.covariance_factor.size(); ++i)
        factor.add(posed->covariance_factor[i], truth.covariance_factor[i]);
      for (size_t i = 0; i < truth.opacity.size(); ++i)
        opacity.add(posed->opacity[i], truth.opacity[i]);
      for (size_t i = 0; i < truth.sh.size(); ++i) sh.add(posed->sh[i], truth.sh[i]);
    }
    EXPECT_LE(position.largest(), 1e-6);
    EXPECT_LE(factor.largest(), 1e-6);
    EXPECT_LE(opacity.largest(), 1e-6);
    EXPECT_LE(sh.largest(), 1e-5);
  }
}

TEST(Renderer, AnAvatarsPictureIsTheOraclesOfItsGaussians) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar avatar = make_test_avatar(body, {.sh_degree = 2});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const SyntheticPose pose = make_test_pose(body.body(), 2);
  const FrameAvatar seen[] = {{.avatar = add(*renderer, avatar, body), .pose = pose.view()}};
  const Camera camera = make_test_camera(160, 200);
  const FloatImage image = tests::render(*renderer, {.camera = camera, .avatars = seen});
  const oracle::Image truth = oracle::render(
      reference_gaussians(avatar.package->avatar(), body.body(), pose.view()), camera);
  std::vector<float> premultiplied = image.rgba;
  for (size_t i = 0; i < premultiplied.size(); ++i)
    premultiplied[i] *= i % 4 == 3 ? 1 : image.rgba[i / 4 * 4 + 3];
  const double psnr = oracle::foreground_psnr_db<float>(truth, premultiplied);
  std::printf("foreground PSNR of a frame, pose to pixels, against double: %.1f dB\n", psnr);
  EXPECT_GE(psnr, 90);
  size_t foreground = 0;
  for (size_t p = 0; p < truth.transmittance.size(); ++p) foreground += truth.alpha(p) > 0.5;
  EXPECT_GT(foreground, 1000u) << "the avatar must be in the picture";
}

TEST(Renderer, AntialiasedIsWhatThePackageSaysUnlessTheFrameDoes) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar package = make_test_avatar(body);
  const SyntheticPose pose = make_test_pose(body.body(), 2);
  Avatar without = package.package->avatar(), with = without;
  with.antialiased = true;
  const std::unique_ptr<Renderer> renderer = make_renderer();
  // Equal but for that: neither may pass for the other.
  const AvatarId plain = *renderer->add_avatar(without, *body.package),
                 filtered = *renderer->add_avatar(with, *body.package);
  const Camera camera = make_test_camera(40, 30);  // texels below a pixel
  const auto draw = [&](AvatarId id, std::optional<bool> antialiased) {
    const FrameAvatar seen[] = {{.avatar = id, .pose = pose.view()}};
    return tests::render(*renderer,
                         {.camera = camera, .avatars = seen, .splat = {.antialiased = antialiased}})
        .rgba;
  };
  EXPECT_EQ(draw(plain, std::nullopt), draw(plain, false));
  EXPECT_EQ(draw(filtered, std::nullopt), draw(plain, true));
  EXPECT_EQ(draw(filtered, false), draw(plain, false));
  EXPECT_NE(draw(plain, true), draw(plain, false));
  // Side by side in a frame each keeps its own; the oracle knows one of both at a time.
  const GaussianView posed = *renderer->pose_avatar(filtered, pose.view());
  const oracle::Image truth =
      oracle::render(oracle::from_view(posed), camera, {.antialiased = true});
  const std::vector<float> drawn = draw(filtered, std::nullopt);
  LargestError error("antialiased avatar");
  for (size_t p = 0; p < truth.transmittance.size(); ++p)
    if (truth.doubtful[p] == 0) error.add(drawn[4 * p + 3], truth.alpha(p));
  EXPECT_LE(error.largest(), 2e-5);
}

TEST(Renderer, SmallestExtentsAreInTheGaussiansOfAPose) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar package = make_test_avatar(body);
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  Avatar avatar = package.package->avatar();
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const auto gaussians = [&] {
    const GaussianView view =
        *renderer->pose_avatar(*renderer->add_avatar(avatar, *body.package), pose.view());
    return std::pair{std::vector<float>(view.opacity.begin(), view.opacity.end()),
                     std::vector<float>(view.position_m.begin(), view.position_m.end())};
  };
  const auto before = gaussians();
  std::vector<uint8_t> codes(body.body().texel_count(), 50);
  codes[3] = 0;
  avatar.smallest_extents = {.scale_m = 1e-4f, .codes = codes};
  const auto after = gaussians();
  EXPECT_EQ(after.second, before.second);
  for (size_t i = 0; i < codes.size(); ++i) {
    if (codes[i] == 0)
      EXPECT_EQ(after.first[i], before.first[i]);
    else
      EXPECT_LT(after.first[i], before.first[i]);
  }
  codes.pop_back();
  avatar.smallest_extents.codes = codes;
  const Result<AvatarId> refused = renderer->add_avatar(avatar, *body.package);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.status().code(), StatusCode::kMismatch);
  EXPECT_NE(refused.status().message().find("smallest extents: "), std::string::npos);
}

TEST(Renderer, AvatarsAndStaticGaussiansOccludeEachOther) {
  // Two cylinders, red at z = +0.6 and blue at z = -0.6, seen from the front and from behind; a
  // green wall between them, at z = 0.
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar red = make_test_avatar(body, {.colour = {2, -2, -2}, .seed = 5}),
                        blue = make_test_avatar(body, {.colour = {-2, -2, 2}, .seed = 6});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  SyntheticPose front = make_test_pose(body.body(), 0), back = front;
  front.root_translation_m[2] = 0.6f;
  back.root_translation_m[2] = -0.6f;
  const FrameAvatar seen[] = {{.avatar = add(*renderer, red, body), .pose = front.view()},
                              {.avatar = add(*renderer, blue, body), .pose = back.view()}};
  Scene wall;
  for (int i = 0; i < 400; ++i) {
    wall.add_ball(
        {-0.5f + 0.05f * static_cast<float>(i % 20), 0.4f + 0.05f * static_cast<float>(i / 20), 0},
        0.05f, 1, {0, 1, 0});
  }
  const GaussianView wall_view = wall.view();
  const auto middle = [&](float azimuth_deg, bool with_wall) {
    const Frame frame{.camera = make_test_camera(101, 101, azimuth_deg),
                      .avatars = seen,
                      .gaussians = with_wall ? std::span<const GaussianView>(&wall_view, 1)
                                             : std::span<const GaussianView>()};
    return tests::render(*renderer, frame).at(50, 50);
  };
  const std::array<float, 4> from_front = middle(0, false), from_behind = middle(180, false);
  EXPECT_GT(from_front[0], from_front[2] + 0.3f) << "red hides blue from the front";
  EXPECT_GT(from_behind[2], from_behind[0] + 0.3f) << "blue hides red from behind";
  // The wall changes neither: it stands behind the nearer one of each side.
  const std::array<float, 4> front_wall = middle(0, true), behind_wall = middle(180, true);
  EXPECT_GT(front_wall[0], front_wall[1] + 0.3f);
  EXPECT_GT(behind_wall[2], behind_wall[1] + 0.3f);
  // Seen from the side nobody stands before the wall's edge.
  const Frame only_back{.camera = make_test_camera(101, 101, 0),
                        .avatars = {seen + 1, 1},
                        .gaussians = {&wall_view, 1}};
  const std::array<float, 4> hidden = tests::render(*renderer, only_back).at(50, 50);
  EXPECT_GT(hidden[1], 0.9f) << "the wall hides blue";
}

TEST(Renderer, OneAvatarTwiceInAFrame) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const AvatarId id = add(*renderer, avatar, body);
  SyntheticPose left = make_test_pose(body.body(), 0), right = left;
  left.root_translation_m[0] = -0.6f;
  right.root_translation_m[0] = 0.6f;
  const FrameAvatar both[] = {{.avatar = id, .pose = left.view()},
                              {.avatar = id, .pose = right.view()}};
  const Camera camera = make_test_camera(96, 96);
  const FloatImage pair = tests::render(*renderer, {.camera = camera, .avatars = both});
  const FloatImage single = tests::render(*renderer, {.camera = camera, .avatars = {both, 1}});
  EXPECT_EQ(renderer->statistics().gaussians, body.body().texel_count());
  LargestError error("left half with and without the right one");
  for (uint32_t y = 0; y < 96; ++y) {
    for (uint32_t x = 0; x < 40; ++x) error.add(pair.at(x, y)[3], single.at(x, y)[3]);
  }
  EXPECT_EQ(error.largest(), 0);
  EXPECT_GT(pair.at(70, 50)[3], 0.5f);
}

TEST(Renderer, TheSamePixelsForAnyNumberOfThreads) {
  const SyntheticBody body = make_test_body({.uv_size = 64});
  const SyntheticAvatar avatar = make_test_avatar(body, {.channels = 8, .sh_degree = 1});
  const SyntheticPose pose = make_test_pose(body.body(), 3);
  const Scene scene = tests::make_random_scene(3000, 2, 9);
  const GaussianView view = scene.view();
  std::vector<std::vector<float>> images;
  std::vector<FrameStatistics> statistics;
  for (const uint32_t threads : {1u, 2u, 3u, 4u}) {
    const std::unique_ptr<Renderer> renderer = make_renderer(threads);
    const FrameAvatar seen[] = {{.avatar = add(*renderer, avatar, body), .pose = pose.view()}};
    images.push_back(tests::render(*renderer, {.camera = make_test_camera(200, 150),
                                               .avatars = seen,
                                               .gaussians = {&view, 1}})
                         .rgba);
    statistics.push_back(renderer->statistics());
  }
  for (size_t i = 1; i < images.size(); ++i) {
    EXPECT_EQ(std::memcmp(images[i].data(), images[0].data(), images[0].size() * sizeof(float)), 0)
        << i + 1 << " threads";
    EXPECT_EQ(statistics[i].visible, statistics[0].visible);
    EXPECT_EQ(statistics[i].pairs, statistics[0].pairs);
    EXPECT_EQ(statistics[i].blends, statistics[0].blends);
  }
}

TEST(Renderer, FramesDoNotRememberEarlierOnes) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const AvatarId id = add(*renderer, avatar, body);
  const SyntheticPose a = make_test_pose(body.body(), 1), b = make_test_pose(body.body(), 2);
  const FrameAvatar first[] = {{.avatar = id, .pose = a.view()}},
                    second[] = {{.avatar = id, .pose = b.view()}};
  const std::vector<uint8_t> before =
      render_bytes(*renderer, {.camera = make_test_camera(80, 80), .avatars = first});
  render_bytes(*renderer, {.camera = make_test_camera(300, 200), .avatars = second});
  const std::vector<uint8_t> small =
      render_bytes(*renderer, {.camera = make_test_camera(16, 16), .avatars = second});
  EXPECT_NE(small, std::vector<uint8_t>(16 * 16 * 4, 0));
  EXPECT_EQ(render_bytes(*renderer, {.camera = make_test_camera(80, 80), .avatars = first}),
            before);
}

TEST(Renderer, MorePairsThanTheListHoldsAreDrawnInBands) {
  // 1,000 Gaussians that fill 12 x 10 tiles: 120,000 pairs, twice the list. 1,000 layers of alpha
  // 0.002 leave 0.998^1000 of the light, everywhere.
  Scene scene;
  for (uint32_t i = 0; i < 1000; ++i)
    scene.add_ball({0, 0, 2 + 1e-4f * static_cast<float>(i)}, 1000, 0.002f,
                   {i < 500 ? 1.0f : 0.0f, 0.5f, 1});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const GaussianView view = scene.view();
  const FloatImage image = tests::render(*renderer, {.camera = tests::front_camera(384, 320, 40),
                                                     .gaussians = {&view, 1},
                                                     .splat = {.alpha_cut = 1e-3f}});
  EXPECT_EQ(renderer->statistics().pairs, 1000u * 120);
  EXPECT_EQ(renderer->statistics().blends, 1000u * 384 * 320);
  const double alpha = 1 - std::pow(0.998, 1000), red = (1 - std::pow(0.998, 500)) / alpha;
  LargestError error("1,000 layers in two bands");
  for (uint32_t y = 0; y < 320; ++y) {
    for (uint32_t x = 0; x < 384; ++x) {
      error.add(image.at(x, y)[3], alpha);
      error.add(image.at(x, y)[0], red);
    }
  }
  EXPECT_LE(error.largest(), 4e-5) << "1 - 0.002 rounds by 3e-8, a thousand times";
  EXPECT_LT(renderer->memory_bytes(), 1u << 20);
}

TEST(Renderer, BackgroundAndAlphaConventions) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.1f, 0.6f, {0.8f, 0.4f, 0.2f});
  const GaussianView view = scene.view();
  Camera camera = tests::front_camera(33, 33, 50);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const FloatImage straight = tests::render(*renderer, {.camera = camera, .gaussians = {&view, 1}});
  const FloatImage over = tests::render(
      *renderer,
      {.camera = camera, .gaussians = {&view, 1}, .background = std::array{0.1f, 0.5f, 0.9f}});
  // In the middle alpha is 0.6: straight colour is the Gaussian's own; over the background 0.6 of
  // it and 0.4 of the background.
  const std::array<float, 4> middle = straight.at(16, 16), mixed = over.at(16, 16);
  const float colour[3] = {0.8f, 0.4f, 0.2f}, behind[3] = {0.1f, 0.5f, 0.9f};
  EXPECT_NEAR(middle[3], 0.6, 1e-6);
  EXPECT_EQ(mixed[3], 1);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(middle[c], colour[c], 1e-6);
    EXPECT_NEAR(mixed[c], 0.6 * colour[c] + 0.4 * behind[c], 1e-6);
  }
  EXPECT_EQ(straight.at(0, 0), (std::array<float, 4>{0, 0, 0, 0}));
  EXPECT_EQ(over.at(0, 0), (std::array<float, 4>{0.1f, 0.5f, 0.9f, 1}));

  const std::vector<uint8_t> bytes = render_bytes(
      *renderer,
      {.camera = camera, .gaussians = {&view, 1}, .background = std::array{0.1f, 0.5f, 0.9f}});
  const std::vector<uint8_t> alpha =
      render_bytes(*renderer, {.camera = camera, .gaussians = {&view, 1}});
  for (size_t i = 0; i < bytes.size(); ++i) {
    ASSERT_NEAR(bytes[i], 255 * over.rgba[i], 0.5001);
    ASSERT_NEAR(alpha[i], 255 * straight.rgba[i], 0.5001);
  }
}

TEST(Renderer, BrightColoursAreClampedInBytesOnly) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.3f, 1, {3, 1.5f, 0});
  const GaussianView view = scene.view();
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Frame frame{.camera = tests::front_camera(9, 9, 20), .gaussians = {&view, 1}};
  EXPECT_NEAR(tests::render(*renderer, frame).at(4, 4)[0], 3, 1e-5);
  const std::vector<uint8_t> bytes = render_bytes(*renderer, frame);
  EXPECT_EQ(bytes[(4 * 9 + 4) * 4], 255);
  EXPECT_EQ(bytes[(4 * 9 + 4) * 4 + 2], 0);
}

TEST(Renderer, RowsMayBeLongerThanTheImage) {
  Scene scene;
  scene.add_ball({0, 0, 2}, 0.3f, 1, {1, 1, 1});
  const GaussianView view = scene.view();
  const std::unique_ptr<Renderer> renderer = make_renderer();
  std::vector<uint8_t> rgba(100 * 40, 77);
  ASSERT_TRUE(renderer
                  ->render({.camera = tests::front_camera(20, 40, 50), .gaussians = {&view, 1}},
                           {.pixels = rgba.data(), .stride_bytes = 100})
                  .ok());
  for (size_t y = 0; y < 40; ++y) {
    for (size_t i = 80; i < 100; ++i)
      ASSERT_EQ(rgba[y * 100 + i], 77) << "bytes behind a row are the caller's";
  }
}

TEST(Renderer, AnEmptyFrameIsItsBackground) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const std::vector<uint8_t> clear = render_bytes(*renderer, {.camera = make_test_camera(40, 30)});
  EXPECT_EQ(clear, std::vector<uint8_t>(40 * 30 * 4, 0));
  const std::vector<uint8_t> white = render_bytes(
      *renderer, {.camera = make_test_camera(40, 30), .background = std::array{1.0f, 1.0f, 1.0f}});
  EXPECT_EQ(white, std::vector<uint8_t>(40 * 30 * 4, 255));
  EXPECT_EQ(renderer->statistics().gaussians, 0u);
}

TEST(Renderer, AMismatchedBodyIsRefusedNamingBothHashes) {
  const SyntheticBody body = make_test_body(), other = make_test_body({.seed = 2});
  const SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *other.package);
  ASSERT_FALSE(id.ok());
  EXPECT_EQ(id.status().code(), StatusCode::kMismatch);
  EXPECT_NE(id.status().message().find(format_hash(body.package->content_hash())),
            std::string::npos)
      << id.status().message();
  EXPECT_NE(id.status().message().find(format_hash(other.package->content_hash())),
            std::string::npos)
      << id.status().message();
}

TEST(Renderer, PackagesOfTheWrongKindAreRefused) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  EXPECT_EQ(renderer->add_avatar(*body.package, *body.package).status().code(),
            StatusCode::kMismatch);
  EXPECT_EQ(renderer->add_avatar(*avatar.package, *avatar.package).status().code(),
            StatusCode::kMismatch);
}

TEST(Renderer, PackageObjectsMayGoWhileTheirBytesStay) {
  SyntheticBody body = make_test_body();
  SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const AvatarId id = add(*renderer, avatar, body);
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const FrameAvatar seen[] = {{.avatar = id, .pose = pose.view()}};
  const Frame frame{.camera = make_test_camera(64, 64), .avatars = seen};
  const std::vector<uint8_t> before = render_bytes(*renderer, frame);
  avatar.package.reset();
  body.package.reset();
  EXPECT_EQ(render_bytes(*renderer, frame), before);
}

TEST(Renderer, UnsoundInputIsRefusedAndNothingIsDrawn) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const AvatarId id = add(*renderer, avatar, body);
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const float nan = std::numeric_limits<float>::quiet_NaN();

  std::vector<uint8_t> rgba(64 * 64 * 16, 77);
  const std::vector<uint8_t> untouched = rgba;
  const auto refuse = [&](const char* what, const Frame& frame, const ImageTarget& target) {
    const Status status = renderer->render(frame, target);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << what << ": " << status.message();
    EXPECT_EQ(rgba, untouched) << what;
  };
  const ImageTarget target{.pixels = rgba.data(), .stride_bytes = 256};
  const FrameAvatar seen[] = {{.avatar = id, .pose = pose.view()}};
  const Frame good{.camera = make_test_camera(64, 64), .avatars = seen};

  Frame frame = good;
  frame.camera.width_px = 0;
  refuse("no width", frame, target);
  frame.camera.width_px = 16385;
  refuse("image too large", frame, target);
  frame = good;
  frame.camera.fx_px = nan;
  refuse("focal length", frame, target);
  frame = good;
  frame.splat.alpha_cut = 0;
  refuse("alpha cut of 0", frame, target);
  frame.splat.alpha_cut = nan;
  refuse("alpha cut of NaN", frame, target);
  frame = good;
  frame.background = std::array{0.0f, nan, 0.0f};
  refuse("background", frame, target);

  refuse("no pixels", good, {.pixels = nullptr, .stride_bytes = 256});
  refuse("short rows", good, {.pixels = rgba.data(), .stride_bytes = 255});
  refuse("short float rows", good,
         {.pixels = rgba.data(), .stride_bytes = 256, .format = PixelFormat::kRgbaF32});
  refuse("misaligned float rows", good,
         {.pixels = rgba.data(), .stride_bytes = 1026, .format = PixelFormat::kRgbaF32});

  SyntheticPose bad = pose;
  bad.rotations[5] = nan;
  const FrameAvatar bad_pose[] = {{.avatar = id, .pose = bad.view()}};
  frame = good;
  frame.avatars = bad_pose;
  refuse("NaN pose", frame, target);
  bad.rotations.resize(4);
  const FrameAvatar short_pose[] = {{.avatar = id, .pose = bad.view()}};
  frame.avatars = short_pose;
  refuse("short pose", frame, target);
  const FrameAvatar nobody[] = {{.avatar = AvatarId(7), .pose = pose.view()}};
  frame.avatars = nobody;
  refuse("unknown avatar", frame, target);
  EXPECT_EQ(renderer->pose_avatar(AvatarId(7), pose.view()).status().code(),
            StatusCode::kInvalidArgument);

  Scene scene;
  scene.add_ball({0, 0, 2}, 0.1f, 1, {1, 1, 1});
  GaussianView view = scene.view();
  view.count = 2;
  frame = good;
  frame.gaussians = {&view, 1};
  refuse("arrays shorter than the count", frame, target);
  view = scene.view();
  view.sh_degree = 4;
  refuse("SH degree 4", frame, target);
}

TEST(Renderer, RemovesAnAvatarAndRefusesItsIdForEver) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar first = make_test_avatar(body, {.seed = 1}),
                        second = make_test_avatar(body, {.seed = 2});
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const auto picture_of = [&](AvatarId id) {
    const FrameAvatar seen[] = {{.avatar = id, .pose = pose.view()}};
    return render_bytes(*renderer, {.camera = make_test_camera(48, 48), .avatars = seen});
  };
  const AvatarId one = add(*renderer, first, body), two = add(*renderer, second, body);
  const std::vector<uint8_t> of_one = picture_of(one), of_two = picture_of(two);
  const uint64_t both_bytes = renderer->memory_bytes();

  EXPECT_TRUE(renderer->remove_avatar(one).ok());
  EXPECT_LT(renderer->memory_bytes(), both_bytes);
  EXPECT_EQ(renderer->remove_avatar(one).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(renderer->pose_avatar(one, pose.view()).status().code(), StatusCode::kInvalidArgument);
  EXPECT_DEATH(static_cast<void>(renderer->precision(one)), "an avatar that is there");
  EXPECT_EQ(picture_of(two), of_two) << "keeps its id";

  const AvatarId again = add(*renderer, first, body);
  EXPECT_NE(again, one);
  EXPECT_NE(again, two);
  EXPECT_EQ(picture_of(again), of_one);
  EXPECT_EQ(renderer->memory_bytes(), both_bytes);
}

// A body's shared texels are found by where its arrays lie: another body at the same place, after
// the first was given back, is another.
TEST(Renderer, ForgetsABodyWithItsLastAvatar) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  std::vector<std::byte> place(1 << 20);
  const size_t shift = (64 - reinterpret_cast<uintptr_t>(place.data()) % 64) % 64;
  for (const uint64_t seed : {1u, 2u}) {
    const SyntheticBody original = make_test_body({.seed = seed});
    const SyntheticAvatar avatar = make_test_avatar(original);
    const std::span<const std::byte> bytes = original.bytes.bytes();
    ASSERT_LE(bytes.size() + shift, place.size());
    std::memcpy(place.data() + shift, bytes.data(), bytes.size());
    const Result<Package> body = Package::open({place.data() + shift, bytes.size()}, "body");
    ASSERT_TRUE(body.ok()) << body.status().message();

    const SyntheticPose pose = make_test_pose(original.body(), 1);
    const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body);
    ASSERT_TRUE(id.ok()) << id.status().message();
    const FrameAvatar moved[] = {{.avatar = *id, .pose = pose.view()}};
    const std::unique_ptr<Renderer> fresh = make_renderer();
    const FrameAvatar kept[] = {{.avatar = add(*fresh, avatar, original), .pose = pose.view()}};
    EXPECT_EQ(render_bytes(*renderer, {.camera = make_test_camera(48, 48), .avatars = moved}),
              render_bytes(*fresh, {.camera = make_test_camera(48, 48), .avatars = kept}));
    EXPECT_TRUE(renderer->remove_avatar(*id).ok());
  }
}

TEST(Renderer, TwoShareAPoolOnTwoThreads) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const auto picture_of = [&](Renderer& renderer) {
    const FrameAvatar seen[] = {{.avatar = add(renderer, avatar, body), .pose = pose.view()}};
    std::vector<uint8_t> last;
    for (int frame = 0; frame < 20; ++frame) {
      last = render_bytes(renderer, {.camera = make_test_camera(48, 48), .avatars = seen});
    }
    return last;
  };
  std::vector<uint8_t> pictures[2];
  {
    Result<std::shared_ptr<ThreadPool>> pool =
        make_thread_pool({.threads = 3, .allow_oversubscription = true});
    ASSERT_TRUE(pool.ok()) << pool.status().message();
    std::unique_ptr<Renderer> renderers[2];
    for (std::unique_ptr<Renderer>& renderer : renderers) {
      Result<std::unique_ptr<Renderer>> created = Renderer::create({.pool = *pool});
      ASSERT_TRUE(created.ok()) << created.status().message();
      renderer = std::move(*created);
      EXPECT_EQ(renderer->threads(), thread_count(**pool));
    }
    *pool = nullptr;  // the renderers hold it
    std::thread other([&] { pictures[1] = picture_of(*renderers[1]); });
    pictures[0] = picture_of(*renderers[0]);
    other.join();
  }
  EXPECT_EQ(pictures[0], picture_of(*make_renderer()));
  EXPECT_EQ(pictures[1], pictures[0]);
  EXPECT_EQ(make_thread_pool({.threads = 0}).status().code(), StatusCode::kInvalidArgument);
}

TEST(Renderer, RefusesNoThreads) {
  EXPECT_EQ(Renderer::create({.threads = 0}).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(Renderer::create({.threads = 65}).status().code(), StatusCode::kInvalidArgument);
}

uint64_t tick(void* now) { return *static_cast<uint64_t*>(now) += 1000; }

TEST(Renderer, StatisticsCountWhatWasDrawn) {
  uint64_t now = 0;
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar avatar = make_test_avatar(body);
  Result<std::unique_ptr<Renderer>> renderer =
      Renderer::create({.threads = 1, .now_ns = tick, .now_user = &now});
  ASSERT_TRUE(renderer.ok());
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const FrameAvatar seen[] = {{.avatar = add(**renderer, avatar, body), .pose = pose.view()}};
  Scene scene;
  scene.add_ball({0, 0.8f, 0.5f}, 1e-6f, 0.5f, {1, 1, 1});
  scene.add_ball({0, 0.8f, 100}, 1e-6f, 0.5f, {1, 1, 1});  // behind the camera
  const GaussianView view = scene.view();
  render_bytes(**renderer,
               {.camera = make_test_camera(64, 64), .avatars = seen, .gaussians = {&view, 1}});
  const FrameStatistics& statistics = (*renderer)->statistics();
  EXPECT_EQ(statistics.gaussians, body.body().texel_count() + 2);
  EXPECT_EQ(statistics.visible, body.body().texel_count() + 1);
  EXPECT_GE(statistics.pairs, statistics.visible);
  EXPECT_GT(statistics.blends, statistics.visible);
  EXPECT_EQ(statistics.macs, count_macs(avatar.package->avatar().network,
                                        *infer_shapes(avatar.package->avatar().network, true)));
  for (size_t stage = 0; stage < kStageCount; ++stage) {
    EXPECT_GT(statistics.stage_ns[stage], 0u) << to_string(static_cast<Stage>(stage));
  }

  const std::unique_ptr<Renderer> without_clock = make_renderer();
  render_bytes(*without_clock, {.camera = make_test_camera(64, 64), .gaussians = {&view, 1}});
  for (uint64_t ns : without_clock->statistics().stage_ns) EXPECT_EQ(ns, 0u);
}

}  // namespace
}  // namespace figurine::renderer_test
