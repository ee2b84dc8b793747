// Everything of a frame around the network, equal to the bit on every CPU, compiler setting and
// number of threads: posed maps, decoding, skinning, projection, sort, blend. One golden number a
// stage, in tests/golden/frame/posed_bodies.json: the first one to differ names the culprit.
//
// XNNPACK's float networks differ in the last bits from CPU to CPU. The network here does not: each
// of its outputs is a bias plus one input times a power of two, a single rounding however it is
// summed. No libm makes any of the input, but for the test body's sines in double.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/writer/package_writer.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine {
namespace {

using tests::Scene;
using tests::SyntheticBody;
using tests::SyntheticPose;

constexpr uint32_t kShDegree = 1;  // of the avatar; the static Gaussians have degree 3

// FNV-1a, 64 bits (Fowler, Noll, Vo), over the values' bytes, which are little-endian wherever
// figurine runs.
class Hash {
 public:
  template <class T>
  Hash& add(std::span<const T> values) {
    for (const std::byte byte : std::as_bytes(values))
      state_ = (state_ ^ std::to_integer<uint64_t>(byte)) * 0x100000001b3u;
    return *this;
  }
  std::string hex() const {
    char text[17];
    std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(state_));
    return text;
  }

 private:
  uint64_t state_ = 0xcbf29ce484222325u;
};

void expect_golden(const std::string& stage, const Hash& hash) {
  static const nlohmann::json golden = nlohmann::json::parse(
      std::ifstream(FIGURINE_SOURCE_DIR "/tests/golden/frame/posed_bodies.json"));
  std::printf("golden frame: %s %s\n", stage.c_str(), hash.hex().c_str());
  EXPECT_EQ(golden.at(stage), hash.hex()) << stage;
}

// One 1x1 convolution with a single weight an output: plus or minus 1/2, 1/4 or 1/8.
std::unique_ptr<Package> make_exact_avatar(const SyntheticBody& body, tests::AlignedBytes& bytes) {
  constexpr uint32_t kOutputs = head_channels(kShDegree);
  tests::Random random(3);
  std::vector<float> weights(size_t{kOutputs} * kMapChannels), bias(kOutputs);
  for (uint32_t o = 0; o < kOutputs; ++o) {
    weights[o * kMapChannels + o % kMapChannels] =
        (o % 2 == 0 ? 1.0f : -1.0f) / static_cast<float>(2u << o % 3);
    bias[o] = random.uniform(-0.5f, 0.5f);
  }
  const std::vector<float> shape = {0.5f, -0.5f};
  const SyntheticPose rest = tests::make_test_pose(body.body(), 0);
  Avatar avatar;
  avatar.name = "exact in float";
  avatar.body_name = body.body().name;
  avatar.body_hash = body.package->content_hash();
  avatar.preset = "test";
  avatar.shape = shape;
  avatar.decoding.sh_degree = kShDegree;
  avatar.network = {
      .input_size = body.body().uv_size,
      .input_channels = kMapChannels,
      .layers = {{.out_channels = kOutputs, .kernel = 1, .weights = weights, .bias = bias}}};
  avatar.golden.rotations = rest.rotations;
  avatar.golden.camera = tests::front_camera(64, 64, 64);
  const Budget budget{
      .peak_memory_bytes = 64 << 20,
      .macs_per_frame = count_macs(avatar.network, *infer_shapes(avatar.network, true)),
      .gaussians = body.body().texel_count()};
  const Result<std::vector<std::byte>> written =
      write_package(avatar, budget, {.tool = "figurine-tests 1", .depicted_person = "synthetic"});
  FIG_CHECK(written.ok(), written.status().message().c_str());
  bytes = tests::AlignedBytes(*written);
  Result<Package> package = Package::open(bytes.bytes(), "exact avatar");
  FIG_CHECK(package.ok(), package.status().message().c_str());
  return std::make_unique<Package>(std::move(package).value());
}

// Needles, discs and balls of 1 mm to 20 cm around the bodies, every band of SH.
Scene make_cloud(uint32_t count) {
  tests::Random random(4);
  Scene scene{.sh_degree = 3};
  for (uint32_t i = 0; i < count; ++i) {
    const std::array<float, 3> place{random.uniform(-1.2f, 1.2f), random.uniform(-0.2f, 1.8f),
                                     random.uniform(-1.5f, 2)};
    const float quaternion[4] = {random.normal(), random.normal(), random.normal(),
                                 random.normal()};
    std::array<float, 9> factor = rotation_from_quaternion(quaternion);
    for (int k = 0; k < 3; ++k) {
      const float root = random.uniform(0.03f, 0.45f), scale = root * root;
      for (int r = 0; r < 3; ++r) factor[3 * r + k] *= scale;
    }
    std::vector<float> sh(3 * sh_coefficients(scene.sh_degree));
    for (size_t k = 0; k < sh.size(); ++k) sh[k] = random.normal() * (k < 3 ? 0.8f : 0.2f);
    scene.add(place, factor, random.uniform(0.02f, 1), sh);
  }
  return scene;
}

// From the front and a little to the side: a rotation about y by the triangle of sides 7, 24, 25,
// in axes with y down and z forward.
Camera make_camera() {
  Camera camera = tests::front_camera(160, 120, 130);
  camera.view_from_world = {0.96f, 0, -0.28f, 0.05f, 0, -1, 0, 0.8f, -0.28f, 0, -0.96f, 2.5f};
  return camera;
}

struct GoldenScene {
  SyntheticBody body = tests::make_test_body({.uv_size = 32, .joints = 5});
  tests::AlignedBytes avatar_bytes;
  std::unique_ptr<Package> avatar = make_exact_avatar(body, avatar_bytes);
  SyntheticPose poses[2] = {tests::make_test_pose(body.body(), 2),
                            tests::make_test_pose(body.body(), 4)};
  Scene cloud = make_cloud(400);
};

TEST(GoldenFrame, InputIsTheSameEverywhere) {
  const GoldenScene scene;
  const Body& body = scene.body.body();
  expect_golden("body", Hash()
                            .add(body.joint_position_m)
                            .add(body.joint_shape_basis_m)
                            .add(body.texel_position_m)
                            .add(body.texel_normal)
                            .add(body.texel_weights)
                            .add(body.texel_spacing_m)
                            .add(body.texel_shape_basis_m));
  const Layer& layer = scene.avatar->avatar().network.layers[0];
  expect_golden("network", Hash().add(layer.weights).add(layer.bias));
  const GaussianView cloud = scene.cloud.view();
  expect_golden(
      "cloud",
      Hash().add(cloud.position_m).add(cloud.covariance_factor).add(cloud.opacity).add(cloud.sh));
}

TEST(GoldenFrame, PosedMapsAreTheSameEverywhere) {
  const GoldenScene scene;
  const Body& body = scene.body.body();
  std::vector<float> maps(size_t(body.uv_size) * body.uv_size * kMapChannels);
  std::vector<Affine> transforms(body.joint_count());
  Hash hash;
  for (const SyntheticPose& pose : scene.poses) {
    draw_pose_maps(body, pose.view(), {}, transforms, kMapChannels, maps);
    hash.add(std::span<const float>(maps));
  }
  expect_golden("maps", hash);
}

TEST(GoldenFrame, PosedGaussiansAreTheSameEverywhere) {
  const GoldenScene scene;
  for (const uint32_t threads : {1u, 2u, 3u}) {
    const std::unique_ptr<Renderer> renderer = tests::make_renderer(threads);
    const Result<AvatarId> id = renderer->add_avatar(*scene.avatar, *scene.body.package);
    ASSERT_TRUE(id.ok()) << id.status().message();
    Hash hash;
    for (const SyntheticPose& pose : scene.poses) {
      const Result<GaussianView> posed = renderer->pose_avatar(*id, pose.view());
      ASSERT_TRUE(posed.ok()) << posed.status().message();
      hash.add(posed->position_m).add(posed->covariance_factor).add(posed->opacity).add(posed->sh);
    }
    expect_golden("gaussians", hash);
  }
}

TEST(GoldenFrame, PixelsAreTheSameEverywhere) {
  const GoldenScene scene;
  const GaussianView cloud = scene.cloud.view();
  const Camera camera = make_camera();
  const size_t values = size_t(camera.width_px) * camera.height_px * 4;
  for (const uint32_t threads : {1u, 2u, 3u}) {
    const std::unique_ptr<Renderer> renderer = tests::make_renderer(threads);
    const Result<AvatarId> id = renderer->add_avatar(*scene.avatar, *scene.body.package);
    ASSERT_TRUE(id.ok()) << id.status().message();
    FrameAvatar seen[] = {{.avatar = *id, .pose = scene.poses[0].view()},
                          {.avatar = *id, .pose = scene.poses[1].view()}};
    seen[1].pose.root_translation_m[0] += 0.5f;
    Frame frame{.camera = camera, .avatars = seen, .gaussians = {&cloud, 1}};
    expect_golden("pixels_f32",
                  Hash().add(std::span<const float>(tests::render(*renderer, frame).rgba)));
    EXPECT_GT(renderer->statistics().visible, 1000u) << "bodies and cloud must be in the picture";

    frame.background = {0.25f, 0.5f, 0.75f};
    std::vector<uint8_t> rgba(values);
    ASSERT_TRUE(
        renderer
            ->render(frame, {.pixels = rgba.data(), .stride_bytes = size_t{4} * camera.width_px})
            .ok());
    expect_golden("pixels_rgba8", Hash().add(std::span<const uint8_t>(rgba)));
  }
}

}  // namespace
}  // namespace figurine
