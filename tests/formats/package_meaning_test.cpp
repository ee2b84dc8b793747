// Behind the checksums: packages whose bytes are whole but whose numbers cannot be true. The writer
// opens what it wrote, so each refusal here is the reader's.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/src/package/text.h"
#include "formats/writer/package_parts.h"

namespace figurine::package_meaning_test {
namespace {

using samples::AvatarSample;
using samples::BodySample;
using samples::ExactBytes;
using samples::expect_refused;
using samples::FixedPointAvatarSample;
using samples::MotionSample;
using samples::Seal;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The status of writing a sample after something was done to it.
template <class Sample>
Status bent(const std::function<void(Sample&)>& bend) {
  Sample sample;
  bend(sample);
  return sample.write().status();
}

Status bent_body(const std::function<void(BodySample&)>& bend) { return bent<BodySample>(bend); }
Status bent_avatar(const std::function<void(AvatarSample&)>& bend) {
  return bent<AvatarSample>(bend);
}
Status bent_motion(const std::function<void(MotionSample&)>& bend) {
  return bent<MotionSample>(bend);
}

// ---- Body ---------------------------------------------------------------------------------------

TEST(PackageBody, RejectsCyclicAndForwardParents) {
  expect_refused(bent_body([](BodySample& s) {
                   s.parents = {-1, 2, 1};
                   s.body.parents = s.parents;
                 }),
                 "joint 1: parent 2 is not an earlier joint");
  expect_refused(bent_body([](BodySample& s) { s.parents[1] = 1; }),
                 "joint 1: parent 1 is not an earlier joint");
  expect_refused(bent_body([](BodySample& s) { s.parents[2] = 3; }), "joint 2: parent 3");
  expect_refused(bent_body([](BodySample& s) { s.parents[2] = -1; }), "joint 2: parent -1");
  expect_refused(bent_body([](BodySample& s) { s.parents[2] = -32768; }), "joint 2");
  expect_refused(bent_body([](BodySample& s) { s.parents[0] = 0; }), "joint 0 is not the root");
}

TEST(PackageBody, RejectsTexelsOutOfOrderOrOutsideTheMap) {
  expect_refused(bent_body([](BodySample& s) { s.texel[1] = s.texel[0]; }), "body.texel: texel 1");
  expect_refused(bent_body([](BodySample& s) { s.texel[0] = 60; }), "body.texel: texel 1");
  expect_refused(bent_body([](BodySample& s) { s.texel[4] = 64; }),
                 "texel 4: lies outside the map");
  expect_refused(bent_body([](BodySample& s) { s.texel[4] = UINT32_MAX; }),
                 "texel 4: lies outside the map");
  expect_refused(bent_body([](BodySample& s) { s.body.uv_size = 2; }),
                 "covers more texels than the map has");
  expect_refused(bent_body([](BodySample& s) { s.body.uv_size = 0; }), "body.uv_size");
  expect_refused(bent_body([](BodySample& s) { s.body.uv_size = kMaxUvSize + 1; }), "body.uv_size",
                 StatusCode::kLimitExceeded);
  // A side whose square is a multiple of 2^32.
  expect_refused(bent_body([](BodySample& s) { s.body.uv_size = 1u << 16; }), "body.uv_size",
                 StatusCode::kLimitExceeded);
}

TEST(PackageBody, RejectsWeightsThatAreNone) {
  expect_refused(bent_body([](BodySample& s) { s.texel_weights[9] = kNan; }),
                 "texel 1: a weight is negative or not a number");
  expect_refused(bent_body([](BodySample& s) { s.texel_weights[9] = -0.25f; }),
                 "texel 1: a weight is negative");
  expect_refused(bent_body([](BodySample& s) { s.texel_weights[9] = kInfinity; }),
                 "the weights sum to inf");
  expect_refused(bent_body([](BodySample& s) { s.texel_weights[9] += 2e-4f; }),
                 "texel 1: the weights sum to 1.0002");
  EXPECT_TRUE(bent_body([](BodySample& s) { s.texel_weights[9] += 5e-5f; }).ok());
}

TEST(PackageBody, RejectsIndicesOutOfRange) {
  expect_refused(bent_body([](BodySample& s) { s.texel_joints[15] = 3; }), "texel 1: joint 3 of 3");
  expect_refused(bent_body([](BodySample& s) { s.border_texel[0] = 64; }),
                 "body.border_texel: entry 0: lies outside the map");
  expect_refused(bent_body([](BodySample& s) { s.border_texel[0] = 9; }),
                 "entry 0: is covered or there twice");
  expect_refused(bent_body([](BodySample& s) { s.border_texel[1] = 1; }),
                 "entry 1: is covered or there twice");
  expect_refused(bent_body([](BodySample& s) { s.border_source[2] = 5; }),
                 "body.border_source: entry 2");
}

TEST(PackageBody, RejectsPlacesOnTheMeshThatAreNone) {
  const auto placed = [](const std::function<void(std::vector<float>&, Body&)>& bend) {
    const std::vector<uint32_t> triangle = {0, 4, 4, 7,
                                            UINT32_MAX};  // the mesh's size is not known
    std::vector<float> weights;
    for (size_t i = 0; i < triangle.size(); ++i)
      weights.insert(weights.end(), {0.5f, 0.375f, 0.125f});
    return bent_body([&](BodySample& s) {
      s.body.texel_triangle = triangle;
      s.body.texel_barycentric = weights;
      bend(weights, s.body);
    });
  };
  EXPECT_TRUE(placed([](auto&, Body&) {}).ok());
  for (float value : {kNan, kInfinity, -0.25f, 1.25f}) {
    expect_refused(placed([&](auto& weights, Body&) { weights[7] = value; }),
                   "body.texel_barycentric: texel 2: is not inside its triangle");
  }
  expect_refused(placed([](auto& weights, Body&) { weights[7] += 2e-4f; }),
                 "body.texel_barycentric: texel 2: sums to 1.0002");
  expect_refused(placed([](auto&, Body& body) { body.texel_triangle = {}; }),
                 "body.texel_triangle: and body.texel_barycentric: one is there without the other");
  expect_refused(placed([](auto&, Body& body) { body.texel_barycentric = {}; }),
                 "body.texel_triangle: and body.texel_barycentric: one is there without the other");
  expect_refused(
      placed([](auto&, Body& body) { body.texel_triangle = body.texel_triangle.first(4); }),
      "body.texel_triangle", StatusCode::kInvalidArgument);
}

TEST(PackageBody, RejectsLengthsThatAreNotPositiveAndFinite) {
  for (float value : {0.0f, -1.0f, kNan, kInfinity}) {
    expect_refused(bent_body([&](BodySample& s) { s.texel_spacing[2] = value; }),
                   "body.texel_spacing: texel 2");
  }
  for (float value : {kNan, kInfinity, -1e30f, 1001.0f}) {
    expect_refused(bent_body([&](BodySample& s) { s.joint_position[8] = value; }),
                   "body.joint_position: value 8");
    expect_refused(bent_body([&](BodySample& s) { s.joint_shape_basis[17] = value; }),
                   "body.joint_shape_basis: value 17");
    expect_refused(bent_body([&](BodySample& s) { s.texel_position[0] = value; }),
                   "body.texel_position: value 0");
    expect_refused(bent_body([&](BodySample& s) { s.texel_shape_basis[29] = value; }),
                   "body.texel_shape_basis: value 29");
  }
  for (float value : {kNan, 2.0f, 0.5f}) {
    expect_refused(bent_body([&](BodySample& s) { s.texel_normal[0] = value; }),
                   "body.texel_normal: texel 0");
  }
}

TEST(PackageBody, RejectsJointNamesThatAreNone) {
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names[2] = "pelvis"; }),
                 "body.joint_names[2]: 'pelvis' is there twice");
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names[2] = ""; }),
                 "body.joint_names[2]: is empty");
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names[1] = "\xC3"; }),
                 "body.joint_names[1]: is not UTF-8");
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names[1] = "a\x1B[2J"; }),
                 "body.joint_names[1]: is not UTF-8 text without control");
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names[1] = std::string(257, 'a'); }),
                 "body.joint_names[1]", StatusCode::kLimitExceeded);
  expect_refused(bent_body([](BodySample& s) { s.body.name = "two\nlines"; }), "body.name");
}

TEST(PackageBody, RejectsAWrongNumberOfShapeCoefficients) {
  expect_refused(bent_body([](BodySample& s) {
                   s.body.texel_shape_basis_m = s.body.texel_shape_basis_m.first(15);
                 }),
                 "body.texel_shape_basis");
  expect_refused(bent_body([](BodySample& s) { s.body.texel_shape_basis_m = {}; }),
                 "body.texel_shape_basis");
  expect_refused(bent_body([](BodySample& s) { s.body.joint_shape_basis_m = {}; }),
                 "body.texel_shape_basis");
  expect_refused(bent_body([](BodySample& s) {
                   s.joint_shape_basis.assign(65 * 9, 0);
                   s.body.joint_shape_basis_m = s.joint_shape_basis;
                 }),
                 "body.joint_shape_basis", StatusCode::kLimitExceeded);
}

// ---- Avatar -------------------------------------------------------------------------------------

TEST(PackageAvatar, RejectsWeightsThatAreNotFinite) {
  for (float value : {kNan, kInfinity, -kInfinity}) {
    expect_refused(bent_avatar([&](AvatarSample& s) { s.weights[0][5] = value; }),
                   "network.0.weights: value 5 is not finite");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.biases.back()[22] = value; }),
                   ".bias: value 22 is not finite");
  }
}

TEST(PackageAvatar, RejectsBoundsOfOffsetsThatAreNone) {
  for (float value : {-1.0f, kNan, kInfinity, 1001.0f}) {
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.decoding.max_offset = value; }),
                   "avatar.decoding.max_offset");
  }
}

TEST(PackageAvatar, RejectsNetworksThatDoNotFitTheHeadOrTheMaps) {
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.decoding.sh_degree = 0; }),
                 "the head needs 14");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.decoding.sh_degree = 4; }),
                 "avatar.decoding.sh_degree");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.fourier_octaves = 2; }),
                 "maps and Fourier channels make 14");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.fourier_octaves = 0xFFFFFFFFu; }),
                 "avatar.fourier_octaves", StatusCode::kLimitExceeded);
  expect_refused(bent_avatar([](AvatarSample& s) {
                   s.avatar.network.input_size = 2048;
                   s.budget = {};
                 }),
                 "network.input_size", StatusCode::kLimitExceeded);
  expect_refused(
      bent_avatar([](AvatarSample& s) {
        s.avatar.network.layers.push_back(
            {.op = LayerOp::kMaxPool2, .inputs = {uint32_t(s.avatar.network.layers.size()), 0}});
      }),
      "does not have the size of the input");
}

TEST(PackageAvatar, RejectsLayersBehindTheWritersBack) {
  // The writer refuses these itself; the reader must too: bend the description after it was taken
  // apart.
  const auto with = [](const std::function<void(Network&)>& bend) {
    AvatarSample sample;
    PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
    bend(sample.avatar.network);
    const ExactBytes bytes(assemble(parts));
    return Package::open(bytes.bytes(), "bent.fgn").status();
  };
  expect_refused(with([](Network& n) { n.layers[3].inputs[0] = 4; }),
                 "network: layer 3: input is not an earlier value");
  expect_refused(with([](Network& n) { n.layers[3].inputs[0] = UINT32_MAX; }),
                 "network: layer 3: input is not an earlier value");
  expect_refused(with([](Network& n) { n.layers[0].kernel = 2; }), "network: layer 0: kernel");
  expect_refused(with([](Network& n) { n.layers[0].kernel = 1; }),
                 "network.0.weights: has shape [2,3,3,10], expected [2,1,1,10]");
  expect_refused(with([](Network& n) { n.layers[0].out_channels = UINT32_MAX; }),
                 "network: layer 0: output channels");
  expect_refused(with([](Network& n) { n.layers[0].out_channels = 3; }),
                 "network.0.weights: has shape");
  expect_refused(with([](Network& n) { n.layers[0].op = static_cast<LayerOp>(9); }),
                 "network: layer 0: unknown operator");
  expect_refused(with([](Network& n) { n.layers.clear(); }),
                 "network: has an input, and no layers");
  expect_refused(with([](Network& n) { n.layers.resize(kMaxLayers + 1); }),
                 "network: more than 256 layers", StatusCode::kLimitExceeded);
  expect_refused(with([](Network& n) { n.input_size = 9; }), "pools an odd size");
  expect_refused(with([](Network& n) { n.input_channels = 0; }), "network: input size or channels");
}

TEST(PackageAvatar, RejectsFixedPointWhoseArithmeticIsNotDefined) {
  using Bend = std::function<void(FixedPointAvatarSample&)>;
  const auto bent = [](const Bend& bend) {
    return package_meaning_test::bent<FixedPointAvatarSample>(bend);
  };
  for (const float scale :
       {0.0f, -0.125f, kNan, kInfinity, std::numeric_limits<float>::denorm_min()}) {
    expect_refused(
        bent([&](FixedPointAvatarSample& s) { s.avatar.fixed_point.values[1].scale = scale; }),
        "fixed point: value 1: the scale");
    expect_refused(bent([&](FixedPointAvatarSample& s) { s.fixed_scales[0][1] = scale; }),
                   "fixed point: layer 0: output 1: the weights' scale");
  }
  expect_refused(
      bent([](FixedPointAvatarSample& s) { s.avatar.fixed_point.values[1].zero_point = -129; }),
      "value 1: the zero point");
  expect_refused(
      bent([](FixedPointAvatarSample& s) { s.avatar.fixed_point.values[0].zero_point = 1; }),
      "value 0: the zero point");
  expect_refused(bent([](FixedPointAvatarSample& s) { s.fixed_weights[0][7] = -128; }),
                 "layer 0: output 0: a weight is -128");
  expect_refused(bent([](FixedPointAvatarSample& s) { s.fixed_biases[0][1] = INT32_MAX; }),
                 "layer 0: output 1: a sum can overflow int32");
  expect_refused(
      bent([](FixedPointAvatarSample& s) { s.avatar.fixed_point.values[3].scale = 0.25f; }),
      "do not share one quantisation");
  expect_refused(bent([](FixedPointAvatarSample& s) { s.avatar.fixed_point.values.pop_back(); }),
                 "fixed point: not one entry per layer");
  expect_refused(
      bent([](FixedPointAvatarSample& s) { s.avatar.network.layers.back().relu = true; }),
      "without ReLU");
  expect_refused(bent([](FixedPointAvatarSample& s) { s.avatar.fixed_point.values.resize(300); }),
                 "more than 256 values", StatusCode::kLimitExceeded);
  expect_refused(
      bent([](FixedPointAvatarSample& s) { s.avatar.golden.fixed_point_library = "two\nlines"; }),
      "golden.fixed_point_library");
}

TEST(PackageAvatar, RejectsNetworksThatAreThereInPart) {
  const auto without = [](const std::string& name, bool with_floats) {
    FixedPointAvatarSample sample;
    if (with_floats) sample.with_floats();
    PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
    EXPECT_EQ(std::erase_if(parts.blobs, [&](const BlobPart& blob) { return blob.name == name; }),
              1u)
        << name;
    const ExactBytes bytes(assemble(parts));
    return Package::open(bytes.bytes(), "bent.fgn").status();
  };
  expect_refused(without("network.0.weights", true),
                 "network.0.weights: is missing, while others are there");
  expect_refused(without("network.23.weights", true),
                 "network.23.weights: is missing, while others are there");
  expect_refused(without("network.4.bias", true),
                 "network.4.bias: is missing, while others are there");
  for (const char* name : {"fixed.0.weights", "fixed.0.scale", "fixed.23.bias"}) {
    expect_refused(without(name, false), std::string(name) + ": is missing");
  }
}

TEST(PackageAvatar, TheHeaderAndTheGoldenHashAgreeWithTheNetwork) {
  const auto with = [](auto& sample, const std::function<void(PackageParts&, Avatar&)>& bend) {
    PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
    bend(parts, sample.avatar);
    const ExactBytes bytes(assemble(parts));
    return Package::open(bytes.bytes(), "bent.fgn").status();
  };
  AvatarSample floats, hashed;
  FixedPointAvatarSample fixed;
  expect_refused(with(floats, [](PackageParts& parts,
                                 Avatar&) { parts.required_features = kFeatureFixedPoint; }),
                 "the bit of fixed point is set, such a network is not there");
  expect_refused(with(fixed, [](PackageParts& parts, Avatar&) { parts.required_features = 0; }),
                 "the bit of fixed point is not set, such a network is there");
  AvatarSample bounded;
  bounded.avatar.decoding.max_offset = 1.5f;
  expect_refused(with(floats, [](PackageParts& parts,
                                 Avatar&) { parts.required_features = kFeatureBoundedOffsets; }),
                 "the bit of bounded offsets is set, such a decoding is not there");
  expect_refused(with(bounded, [](PackageParts& parts, Avatar&) { parts.required_features = 0; }),
                 "the bit of bounded offsets is not set, such a decoding is there");
  expect_refused(
      with(hashed, [](PackageParts&, Avatar& avatar) { avatar.golden.fixed_point_hash[1] = 1; }),
      "golden.fixed_point_hash");
}

TEST(PackageAvatar, RejectsFixedPointBehindTheWritersBack) {
  const auto with = [](const std::string& name, const std::function<void(BlobPart&)>& bend) {
    FixedPointAvatarSample sample;
    PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
    for (BlobPart& blob : parts.blobs) {
      if (blob.name == name) bend(blob);
    }
    const ExactBytes bytes(assemble(parts));
    return Package::open(bytes.bytes(), "bent.fgn").status();
  };
  expect_refused(with("fixed.0.weights", [](BlobPart& blob) { blob.type = DataType::kU8; }),
                 "fixed.0.weights: is u8, not i8");
  expect_refused(with("fixed.0.bias", [](BlobPart& blob) { blob.type = DataType::kU32; }),
                 "fixed.0.bias: is u32, not i32");
  expect_refused(with("fixed.0.weights", [](BlobPart& blob) { blob.shape = {180}; }),
                 "fixed.0.weights: has shape [180], expected [2,3,3,10]");
  expect_refused(with("fixed.0.scale",
                      [](BlobPart& blob) { blob.bytes = blob.bytes.first(4), blob.shape = {1}; }),
                 "fixed.0.scale: has shape [1], expected [2]");
}

TEST(PackageAvatar, RejectsDecodingsThatCannotBe) {
  for (float value : {0.0f, -1.0f, kNan, kInfinity, 1e30f}) {
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.decoding.offset_scale_m = value; }),
                   "avatar.decoding.offset_scale_m");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.decoding.spacing_scale = value; }),
                   "avatar.decoding.spacing_scale");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.decoding.max_log_scale = value; }),
                   "avatar.decoding.max_log_scale");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.map_statistics.scale[5] = value; }),
                   "avatar.map_statistics: channel 5");
  }
  for (float value : {kNan, kInfinity, -1e30f}) {
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.decoding.opacity_bias = value; }),
                   "avatar.decoding.opacity_bias");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.avatar.map_statistics.mean[0] = value; }),
                   "avatar.map_statistics: channel 0");
    expect_refused(bent_avatar([&](AvatarSample& s) { s.shape[1] = value; }),
                   "avatar.shape: value 1");
  }
  expect_refused(bent_avatar([](AvatarSample& s) {
                   s.shape.assign(65, 0);
                   s.avatar.shape = s.shape;
                 }),
                 "avatar.shape", StatusCode::kLimitExceeded);
  expect_refused(
      bent_avatar([](AvatarSample& s) { s.avatar.template_mode = static_cast<TemplateMode>(2); }),
      "avatar.template_mode", StatusCode::kUnsupported);
}

TEST(PackageAvatar, RejectsBudgetsThatTheNetworkBreaks) {
  expect_refused(bent_avatar([](AvatarSample& s) { s.budget.macs_per_frame -= 1; }),
                 "budget.macs_per_frame", StatusCode::kLimitExceeded);
  expect_refused(bent_avatar([](AvatarSample& s) { s.budget.peak_memory_bytes = 100; }),
                 "budget.peak_memory_bytes", StatusCode::kLimitExceeded);
  expect_refused(bent_avatar([](AvatarSample& s) { s.budget.gaussians = 65; }), "budget.gaussians");
  EXPECT_TRUE(bent_avatar([](AvatarSample& s) { s.budget = {}; }).ok());
}

TEST(PackageAvatar, RejectsNetworksTooLargeForAnyDevice) {
  // 1024 x 1024 x 512 floats: 2 GiB for one activation, from weights of 30 kB.
  const Status status = bent_avatar([](AvatarSample& s) {
    s.avatar.network = {.input_size = 1024,
                        .input_channels = 10,
                        .layers = {{.op = LayerOp::kConv2d, .out_channels = 512, .kernel = 1}}};
    s.weights.assign(1, std::vector<float>(5120));
    s.biases.assign(1, std::vector<float>(512));
    s.avatar.network.layers[0].weights = s.weights[0];
    s.avatar.network.layers[0].bias = s.biases[0];
    const uint32_t head = head_channels(1);
    s.avatar.network.layers.push_back(
        {.op = LayerOp::kConv2d, .inputs = {1, 0}, .out_channels = head, .kernel = 1});
    s.weights.emplace_back(512 * head);
    s.biases.emplace_back(head);
    s.avatar.network.layers[1].weights = s.weights[1];
    s.avatar.network.layers[1].bias = s.biases[1];
    s.avatar.network.layers[0].weights = s.weights[0];
    s.avatar.network.layers[0].bias = s.biases[0];
    s.budget = {};
  });
  expect_refused(status, "an activation is larger than 1 GiB", StatusCode::kLimitExceeded);
}

TEST(PackageAvatar, RejectsPoseStatisticsThatCannotBeInverted) {
  expect_refused(bent_avatar([](AvatarSample& s) { s.pose_covariance[1] = 0.25f; }),
                 "pose.covariance: is not symmetric in row 1, column 0");
  expect_refused(bent_avatar([](AvatarSample& s) { s.pose_covariance[8] = 0; }),
                 "pose.covariance: row 2: the variance is not positive");
  expect_refused(
      bent_avatar([](AvatarSample& s) { s.pose_covariance[1] = s.pose_covariance[3] = 0.5f; }),
      "pose.covariance: is not positive definite");
  expect_refused(
      bent_avatar([](AvatarSample& s) { s.pose_covariance[1] = s.pose_covariance[3] = kNan; }),
      "pose.covariance: value 1 is not finite");
  expect_refused(bent_avatar([](AvatarSample& s) { s.pose_mean[2] = kInfinity; }),
                 "pose.mean: value 2 is not finite");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.pose_statistics.joints = {1, 1}; }),
                 "pose.mean", StatusCode::kInvalidArgument);
  expect_refused(bent_avatar([](AvatarSample& s) {
                   s.avatar.pose_statistics.joints = {1, 1};
                   s.pose_mean.assign(6, 0);
                   s.pose_covariance.assign(36, 0);
                   s.avatar.pose_statistics.mean = s.pose_mean;
                   s.avatar.pose_statistics.covariance = s.pose_covariance;
                 }),
                 "lists a joint twice");
}

TEST(PackageAvatar, RejectsGoldenFramesThatCannotBeDrawn) {
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.camera.fx_px = 0; }),
                 "golden: camera: focal lengths");
  expect_refused(
      bent_avatar([](AvatarSample& s) { s.avatar.golden.camera.view_from_world[0] = 2; }),
      "golden: camera");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.camera.near_m = kNan; }),
                 "golden: camera: the near distance");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.camera.width_px = 0; }),
                 "golden: camera: image size");
  expect_refused(bent_avatar([](AvatarSample& s) { s.golden_rotations[0] = 0; }),
                 "golden: pose: the rotation of joint 0 is zero");
  expect_refused(bent_avatar([](AvatarSample& s) { s.golden_rotations[4] = kNan; }),
                 "golden: pose: the rotation of joint 1");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.root_translation_m[1] = kNan; }),
                 "golden: pose: the root translation");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.background[1] = 1.5f; }),
                 "golden.background");
  expect_refused(bent_avatar([](AvatarSample& s) { s.golden_png[1] = 'J'; }),
                 "golden.png: is not a PNG file");
  expect_refused(
      bent_avatar([](AvatarSample& s) { s.avatar.golden.png = s.avatar.golden.png.first(20); }),
      "golden.png: is not a PNG file");
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.camera.width_px = 17; }),
                 "golden.png: does not have the golden camera's size");
}

// ---- Motion -------------------------------------------------------------------------------------

TEST(PackageMotion, RejectsPosesThatAreNone) {
  for (float value : {kNan, kInfinity, 0.0f, 1.01f}) {
    expect_refused(bent_motion([&](MotionSample& s) { s.rotations[16] = value; }),
                   "motion.rotations: frame 2, joint 0: not a unit quaternion");
  }
  EXPECT_TRUE(bent_motion([](MotionSample& s) { s.rotations[16] = 1.0005f; }).ok());
  expect_refused(bent_motion([](MotionSample& s) { s.root_translation[4] = kNan; }),
                 "motion.root_translation: value 4 is not finite");
  for (float value : {0.0f, -30.0f, kNan, kInfinity}) {
    expect_refused(bent_motion([&](MotionSample& s) { s.motion.frames_per_second = value; }),
                   "motion.frames_per_second");
  }
  expect_refused(bent_motion([](MotionSample& s) {
                   s.motion.frame_count = 0;
                   s.motion.rotations = s.motion.root_translation_m = {};
                 }),
                 "motion.root_translation: is missing");
}

// ---- Words --------------------------------------------------------------------------------------

TEST(PackageProvenance, RejectsFiguresThatAreNotFiniteAndTextThatIsNone) {
  const auto with = [](const std::function<void(Provenance&)>& bend) {
    const MotionSample sample;
    Provenance provenance = samples::make_provenance();
    bend(provenance);
    return write_package(sample.motion, provenance).status();
  };
  EXPECT_TRUE(with([](Provenance& p) { p = {}; }).ok());
  expect_refused(
      with([](Provenance& p) { p.quality[1].value = std::numeric_limits<double>::quiet_NaN(); }),
      "provenance.quality[1]: is not finite");
  expect_refused(with([](Provenance& p) { p.tool = "\xFF"; }), "provenance.tool");
  expect_refused(with([](Provenance& p) { p.settings[0].key = "a\nb"; }),
                 "provenance.settings[0].key");
  expect_refused(with([](Provenance& p) { p.sources[1] = std::string("a\0b", 3); }),
                 "provenance.sources[1]");
  expect_refused(with([](Provenance& p) { p.licence_url = std::string(4097, 'x'); }),
                 "provenance.licence_url", StatusCode::kLimitExceeded);
  expect_refused(with([](Provenance& p) { p.authors.assign(1025, "x"); }), "provenance.authors",
                 StatusCode::kLimitExceeded);
}

TEST(PackageText, FollowsTheUtf8TableAndKeepsControlCharactersOut) {
  const char* const sound[] = {"",
                               "plain",
                               "\xC2\xA0",
                               "\xDF\xBF",
                               "\xE0\xA0\x80",
                               "\xED\x9F\xBF",
                               "\xEE\x80\x80",
                               "\xF0\x90\x80\x80",
                               "\xF4\x8F\xBF\xBF"};
  for (const char* text : sound) EXPECT_TRUE(is_clean_text(text, false)) << text;
  const char* const unsound[] = {"\x80",              // continuation alone
                                 "\xC0\x80",          // overlong NUL
                                 "\xC1\xBF",          // overlong
                                 "\xE0\x9F\xBF",      // overlong
                                 "\xF0\x8F\xBF\xBF",  // overlong
                                 "\xED\xA0\x80",      // surrogate
                                 "\xF4\x90\x80\x80",  // above U+10FFFF
                                 "\xF5\x80\x80\x80",
                                 "\xFF",
                                 "\xE2\x82",  // cut
                                 "\xC3(",     // no continuation
                                 "\x1B[31m",
                                 "\x7F",
                                 "\xC2\x9B"};  // U+009B, a terminal's control sequence introducer
  for (const char* text : unsound) EXPECT_FALSE(is_clean_text(text, true)) << text;
  EXPECT_TRUE(is_clean_text("a\tb\n", true));
  EXPECT_FALSE(is_clean_text("a\tb\n", false));
}

TEST(PackageIndex, RejectsUnknownConventions) {
  const Result<std::vector<std::byte>> written = MotionSample().write();
  const Seal seal(*written);
  // The five conventions are five neighbouring zero bytes of the index: bend every byte in turn and
  // look for them.
  size_t run = 0, longest = 0;
  for (size_t at = kPackageHeaderBytes;
       at < kPackageHeaderBytes + samples::get_header(*written).index_bytes; ++at) {
    ExactBytes bytes(*written);
    const bool was_zero = bytes.bytes()[at] == std::byte{0};
    bytes.bytes()[at] = std::byte{1};
    seal.renew(bytes.bytes());
    const Status status = Package::open(bytes.bytes(), "bent.fgn").status();
    const bool refused = status.code() == StatusCode::kUnsupported &&
                         status.message().rfind("bent.fgn: index.conventions: ", 0) == 0;
    run = was_zero && refused ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  EXPECT_EQ(longest, 5u);
}

// ---- The writer's own refusals ------------------------------------------------------------------

TEST(PackageWriter, RejectsArraysWhoseLengthFitsNoShape) {
  constexpr StatusCode kInvalid = StatusCode::kInvalidArgument;
  expect_refused(
      bent_body([](BodySample& s) { s.body.texel_position_m = s.body.texel_position_m.first(14); }),
      "body.texel_position", kInvalid);
  expect_refused(
      bent_body([](BodySample& s) { s.body.texel_normal = s.body.texel_normal.first(12); }),
      "body.texel_normal", kInvalid);
  expect_refused(bent_body([](BodySample& s) { s.body.joint_names.pop_back(); }), "body.parents",
                 kInvalid);
  expect_refused(
      bent_body([](BodySample& s) { s.body.border_source = s.body.border_source.first(2); }),
      "body.border_source", kInvalid);
  expect_refused(bent_body([](BodySample& s) { s.body.texel_weights = {}; }), "body.texel_weights",
                 kInvalid);
  expect_refused(bent_motion([](MotionSample& s) { s.motion.frame_count = 2; }),
                 "motion.root_translation", kInvalid);
  expect_refused(bent_motion([](MotionSample& s) { s.motion.joint_names.pop_back(); }),
                 "motion.rotations", kInvalid);
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.network.layers[0].bias = {}; }),
                 "network: layer 0", kInvalid);
  expect_refused(bent_avatar([](AvatarSample& s) {
                   s.avatar.golden.rotations = s.avatar.golden.rotations.first(11);
                 }),
                 "golden.rotations", kInvalid);
  expect_refused(bent_avatar([](AvatarSample& s) { s.avatar.golden.rotations = {}; }), "golden.png",
                 kInvalid);
}

// ---- What belongs together ----------------------------------------------------------------------

TEST(PackageFit, AvatarsNameTheirBody) {
  const BodySample body_sample;
  const AlignedBytes body_bytes(*body_sample.write());
  const Package body = Package::open(body_bytes.bytes(), "body.fgn").value();
  AvatarSample sample;
  expect_refused(check_avatar_fits_body(sample.avatar, body), format_hash(sample.avatar.body_hash),
                 StatusCode::kMismatch);
  expect_refused(check_avatar_fits_body(sample.avatar, body), format_hash(body.content_hash()),
                 StatusCode::kMismatch);
  sample.avatar.body_hash = body.content_hash();
  EXPECT_TRUE(check_avatar_fits_body(sample.avatar, body).ok());

  const auto expect_mismatch = [&](const std::function<void(AvatarSample&)>& bend,
                                   const std::string& words) {
    AvatarSample bent_sample;
    bent_sample.avatar.body_hash = body.content_hash();
    bend(bent_sample);
    expect_refused(check_avatar_fits_body(bent_sample.avatar, body), words, StatusCode::kMismatch);
  };
  expect_mismatch([](AvatarSample& s) { s.avatar.network.input_size = 16; },
                  "16 texels a side, the body's 8");
  expect_mismatch(
      [](AvatarSample& s) {
        s.shape.resize(3);
        s.avatar.shape = s.shape;
      },
      "3 shape coefficients, the body 2");
  expect_mismatch(
      [](AvatarSample& s) { s.avatar.golden.rotations = s.avatar.golden.rotations.first(8); },
      "golden pose has 2 joints, the body 3");
  expect_mismatch([](AvatarSample& s) { s.avatar.pose_statistics.joints = {3}; }, "name joint 3");

  const AlignedBytes motion_bytes(*MotionSample().write());
  const Package motion = Package::open(motion_bytes.bytes(), "motion.fgn").value();
  expect_refused(check_avatar_fits_body(sample.avatar, motion), "is of kind motion",
                 StatusCode::kMismatch);
}

TEST(PackageFit, MotionsHaveTheBodysJoints) {
  const BodySample body;
  MotionSample motion;
  expect_refused(check_motion_fits_body(motion.motion, body.body), "it has 2 joints, the body 3",
                 StatusCode::kMismatch);
  motion.motion.joint_names = {"pelvis", "spine1", "jaw"};
  expect_refused(check_motion_fits_body(motion.motion, body.body),
                 "its joint 2 is 'jaw', the body's 'head'", StatusCode::kMismatch);
  motion.motion.joint_names = body.body.joint_names;
  EXPECT_TRUE(check_motion_fits_body(motion.motion, body.body).ok());
}

}  // namespace
}  // namespace figurine::package_meaning_test
