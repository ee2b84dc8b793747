#include "runtime/test_packages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/writer/package_writer.h"
#include "runtime/nn/quantise_network.h"
#include "runtime/pose/random_static_part.h"

namespace figurine::tests {
namespace {

Provenance provenance() {
  return {.tool = "figurine-tests 1", .licence_name = "CC0-1.0", .depicted_person = "synthetic"};
}

std::unique_ptr<Package> open(const AlignedBytes& bytes, const char* name) {
  Result<Package> package = Package::open(bytes.bytes(), name);
  FIG_CHECK(package.ok(), package.status().message().c_str());
  return std::make_unique<Package>(std::move(package).value());
}

// Random ones, kept in storage. Returns the shapes of the network's values.
std::vector<ValueShape> choose_weights(Network& network, const SyntheticAvatarOptions& options,
                                       Random& random, std::vector<std::vector<float>>& storage) {
  const Result<std::vector<ValueShape>> inferred = infer_shapes(network, false);
  FIG_CHECK(inferred.ok(), inferred.status().message().c_str());
  const std::vector<ValueShape>& shapes = *inferred;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const bool is_head = i + 1 == network.layers.size();
    const uint32_t fan_in = layer.kernel * layer.kernel * shapes[layer.inputs[0]].channels;
    std::vector<float> weights(size_t(layer.out_channels) * fan_in), bias(layer.out_channels);
    const float deviation = std::sqrt(2.0f / static_cast<float>(fan_in)) * (is_head ? 0.3f : 1.0f);
    for (float& weight : weights) weight = deviation * random.normal();
    for (float& value : bias) value = 0.05f * random.normal();
    if (is_head) {
      for (int c = 0; c < 3; ++c)
        bias[11 + c] = options.colour.empty() ? random.uniform(-1, 1) : options.colour[c];
    }
    storage.push_back(std::move(weights));
    layer.weights = storage.back();
    storage.push_back(std::move(bias));
    layer.bias = storage.back();
  }
  return shapes;
}

}  // namespace

AlignedBytes::AlignedBytes(std::span<const std::byte> bytes)
    : storage_(bytes.size() + kBlobAlignment), size_(bytes.size()) {
  offset_ = (kBlobAlignment - reinterpret_cast<uintptr_t>(storage_.data()) % kBlobAlignment) %
            kBlobAlignment;
  std::memcpy(storage_.data() + offset_, bytes.data(), bytes.size());
}

float Random::uniform(float low, float high) {
  state_ = state_ * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (static_cast<float>(state_ >> 40) * 0x1p-24f);
}

float Random::normal() {
  float sum = -6;
  for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
  return sum;
}

SyntheticBody make_test_body(const SyntheticBodyOptions& options) {
  constexpr double kPi = 3.14159265358979323846;
  constexpr float kRadius = 0.2f, kHeight = 1.6f;
  const uint32_t size = options.uv_size, joints = options.joints, shapes = options.shapes;
  Random random(options.seed);

  Body body;
  body.name = "jointed cylinder";
  body.uv_size = size;
  std::vector<int16_t> parents;
  std::vector<float> joint_position;
  for (uint32_t j = 0; j < joints; ++j) {
    body.joint_names.push_back(options.joint_names.empty() ? "joint" + std::to_string(j)
                                                           : options.joint_names[j]);
    parents.push_back(static_cast<int16_t>(static_cast<int>(j) - 1));
    const float place[3] = {0, kHeight * static_cast<float>(j) / static_cast<float>(joints), 0};
    joint_position.insert(joint_position.end(), place, place + 3);
  }

  // The chart covers all but three texels at each side: two for the border's dilation, one that
  // stays empty.
  constexpr uint32_t kMargin = 3;
  std::vector<uint32_t> texel, border_texel, border_source;
  std::vector<float> position, normal, weights, spacing;
  std::vector<uint8_t> influences;
  const uint32_t side = size - 2 * kMargin;
  for (uint32_t v = kMargin; v < size - kMargin; ++v) {
    for (uint32_t u = kMargin; u < size - kMargin; ++u) {
      texel.push_back(v * size + u);
      const double angle = 2 * kPi * (u - kMargin + 0.5) / side;
      const float out[3] = {static_cast<float>(std::sin(angle)), 0,
                            static_cast<float>(std::cos(angle))};
      const float y =
          kHeight * (1.0f - (static_cast<float>(v - kMargin) + 0.5f) / static_cast<float>(side));
      const float place[3] = {kRadius * out[0], y, kRadius * out[2]};
      position.insert(position.end(), place, place + 3);
      normal.insert(normal.end(), out, out + 3);
      // Between the two joints around it, linearly.
      const float along =
          std::min(y / kHeight * static_cast<float>(joints), static_cast<float>(joints) - 1.001f);
      const uint32_t below = static_cast<uint32_t>(along);
      const float part = along - static_cast<float>(below);
      const uint8_t who[kSkinInfluences] = {static_cast<uint8_t>(below),
                                            static_cast<uint8_t>(std::min(below + 1, joints - 1))};
      const float share[kSkinInfluences] = {1 - part, part};
      influences.insert(influences.end(), who, who + kSkinInfluences);
      weights.insert(weights.end(), share, share + kSkinInfluences);
      spacing.push_back(std::max(kHeight, 2 * static_cast<float>(kPi) * kRadius) /
                        static_cast<float>(side));
    }
  }
  for (uint32_t v = kMargin - 2; v < size - kMargin + 2; ++v) {
    for (uint32_t u = kMargin - 2; u < size - kMargin + 2; ++u) {
      const uint32_t near_u = std::min(std::max(u, kMargin), size - kMargin - 1),
                     near_v = std::min(std::max(v, kMargin), size - kMargin - 1);
      if (near_u == u && near_v == v) continue;
      border_texel.push_back(v * size + u);
      border_source.push_back((near_v - kMargin) * side + (near_u - kMargin));
    }
  }
  std::vector<float> joint_basis(size_t(shapes) * joints * 3),
      texel_basis(size_t(shapes) * position.size());
  for (float& value : joint_basis) value = 0.02f * random.uniform(-1, 1);
  for (float& value : texel_basis) value = 0.02f * random.uniform(-1, 1);

  body.parents = parents;
  body.joint_position_m = joint_position;
  body.joint_shape_basis_m = joint_basis;
  body.texel = texel;
  body.texel_position_m = position;
  body.texel_normal = normal;
  body.texel_joints = influences;
  body.texel_weights = weights;
  body.texel_spacing_m = spacing;
  body.texel_shape_basis_m = texel_basis;
  body.border_texel = border_texel;
  body.border_source = border_source;
  const Result<std::vector<std::byte>> written = write_package(body, provenance());
  FIG_CHECK(written.ok(), written.status().message().c_str());
  SyntheticBody result{.bytes = AlignedBytes(*written), .package = nullptr};
  result.package = open(result.bytes, "test body");
  return result;
}

SyntheticAvatar make_test_avatar(const SyntheticBody& body, const SyntheticAvatarOptions& options) {
  Random random(options.seed + 1000);
  Avatar avatar;
  avatar.name = options.name;
  avatar.body_name = body.body().name;
  avatar.body_hash = body.package->content_hash();
  avatar.preset = "test";
  avatar.template_mode = options.template_mode;
  avatar.shape = options.shape;
  if (options.network_step != 1) avatar.uv_size = body.body().uv_size;
  avatar.decoding.sh_degree = options.sh_degree;
  std::unique_ptr<RandomStaticPart> static_part;
  if (options.static_part) {
    static_part = std::make_unique<RandomStaticPart>(body.body(), options.seed);
    avatar.static_part = static_part->part;
  }
  std::vector<uint8_t> extents;
  if (options.filters) {
    for (uint32_t i = 0; i < body.body().texel_count(); ++i)
      extents.push_back(static_cast<uint8_t>(i * 37 % 256));
    avatar.smallest_extents = {.scale_m = 2e-5f, .codes = extents};
    avatar.antialiased = true;
  }
  const size_t features = size_t{3} * body.body().joint_count();
  const std::vector<float> mean(features, 0), distances{0.25f, 0.5f, 1, 1.5f, 2};
  std::vector<float> covariance(features * features, 0);
  for (size_t i = 0; i < features; ++i) covariance[i * features + i] = 0.04f;
  if (options.known_poses) {
    avatar.pose_statistics = {{}, mean, covariance, distances};
    for (uint32_t j = 0; j < body.body().joint_count(); ++j)
      avatar.pose_statistics.joints.push_back(static_cast<uint8_t>(j));
  }
  uint64_t macs = 0;
  std::vector<std::vector<float>> storage;
  std::unique_ptr<QuantisedNetwork> quantised;
  if (options.network_step != 0) {
    avatar.fourier_octaves = options.fourier_octaves;
    avatar.network = make_pose_unet(body.body().uv_size / options.network_step,
                                    kMapChannels + 4 * options.fourier_octaves, options.channels,
                                    head_channels(options.sh_degree));
    macs = count_macs(avatar.network, choose_weights(avatar.network, options, random, storage));
    if (options.held != Held::kFloat32) {
      const SyntheticPose bent = make_test_pose(body.body(), 1);
      quantised = std::make_unique<QuantisedNetwork>(
          avatar.network, network_input(avatar, body.body(), bent.view()));
      avatar.fixed_point = quantised->fixed;
    }
    if (options.held == Held::kFixedPoint) {
      for (Layer& layer : avatar.network.layers) layer.weights = layer.bias = {};
    }
  }
  const SyntheticPose rest = make_test_pose(body.body(), 0);
  avatar.golden.rotations = rest.rotations;
  avatar.golden.camera = make_test_camera(64, 64);

  const Budget budget{.peak_memory_bytes = 64 << 20,
                      .macs_per_frame = macs,
                      .gaussians = body.body().texel_count()};
  const Result<std::vector<std::byte>> written = write_package(avatar, budget, provenance());
  FIG_CHECK(written.ok(), written.status().message().c_str());
  SyntheticAvatar result{.bytes = AlignedBytes(*written), .package = nullptr};
  result.package = open(result.bytes, "test avatar");
  return result;
}

std::vector<float> network_input(const Avatar& avatar, const Body& body, const PoseView& pose) {
  const TexelGrid grid = make_texel_grid(body, avatar.network.input_size);
  const uint32_t stride = avatar.network.input_channels;
  std::vector<float> maps(size_t{body.uv_size} * body.uv_size * kMapChannels),
      input(size_t{grid.size} * grid.size * stride);
  std::vector<Affine> transforms(body.joint_count());
  draw_pose_maps(body, pose, avatar.map_statistics, transforms, kMapChannels, maps);
  draw_fourier_channels(grid.size, avatar.fourier_octaves, kMapChannels, stride, input);
  const auto draw = [&](uint32_t cell, uint32_t source) {
    std::copy_n(&maps[size_t{body.texel[source]} * kMapChannels], kMapChannels,
                &input[size_t{cell} * stride]);
  };
  for (uint32_t i = 0; i < grid.cell_count(); ++i) draw(grid.cell[i], grid.source[i]);
  for (size_t i = 0; i < grid.border_cell.size(); ++i)
    draw(grid.border_cell[i], grid.source[grid.border_source[i]]);
  return input;
}

SyntheticPose make_test_pose(const Body& body, uint32_t frame) {
  SyntheticPose pose;
  for (uint32_t j = 0; j < body.joint_count(); ++j) {
    const float bend =
        frame == 0 ? 0.0f : 0.15f * static_cast<float>((frame * 7 + j * 3) % 5) - 0.3f;
    const float wxyz[4] = {1, j % 2 == 0 ? bend : 0, 0.5f * bend, j % 2 == 1 ? bend : 0};
    pose.rotations.insert(pose.rotations.end(), wxyz, wxyz + 4);
  }
  if (frame > 0)
    pose.root_translation_m = {0.05f * static_cast<float>(frame % 3), 0,
                               0.02f * static_cast<float>(frame % 5)};
  return pose;
}

Camera make_test_camera(uint32_t width_px, uint32_t height_px, float azimuth_deg) {
  const Result<Camera> camera = make_orbit_camera({.azimuth_deg = azimuth_deg,
                                                   .elevation_deg = 5,
                                                   .distance_m = 2.5f,
                                                   .vertical_fov_deg = 45,
                                                   .target_m = {0, 0.8f, 0}},
                                                  width_px, height_px);
  FIG_CHECK(camera.ok(), camera.status().message().c_str());
  return *camera;
}

}  // namespace figurine::tests
