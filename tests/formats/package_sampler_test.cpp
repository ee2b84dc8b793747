// Samplers: what goes in comes out, what a package cannot hold is left out or refused, and packages
// whose bytes are whole but whose numbers cannot be true are no samplers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <set>

#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"

namespace figurine::package_sampler_test {
namespace {

using samples::ExactBytes;
using samples::expect_refused;
using samples::open_or_die;
using samples::Opened;
using samples::same;
using samples::SamplerSample;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// ---- Round trip ---------------------------------------------------------------------------------

TEST(SamplerRoundTrip, KeepsWhatItsAvatarsShare) {
  const SamplerSample sample;
  const Opened opened = open_or_die(sample.write());
  ASSERT_EQ(opened.package.kind(), PackageKind::kSampler);
  const Sampler &in = sample.sampler, &out = opened.package.sampler();
  EXPECT_EQ(in.name, out.name);
  EXPECT_EQ(in.body_name, out.body_name);
  EXPECT_EQ(in.body_hash, out.body_hash);
  EXPECT_EQ(in.preset, out.preset);
  EXPECT_EQ(in.template_mode, out.template_mode);
  EXPECT_EQ(in.fourier_octaves, out.fourier_octaves);
  EXPECT_EQ(in.network.input_size, out.network.input_size);
  ASSERT_EQ(in.network.layers.size(), out.network.layers.size());
  for (size_t i = 0; i < in.network.layers.size(); ++i) {
    EXPECT_EQ(in.network.layers[i].op, out.network.layers[i].op) << i;
    EXPECT_EQ(in.network.layers[i].out_channels, out.network.layers[i].out_channels) << i;
  }
  EXPECT_FALSE(has_weights(out.network));
  EXPECT_EQ(out.shape_count, 2u);
  EXPECT_EQ(in.map_statistics.mean, out.map_statistics.mean);
  EXPECT_EQ(in.map_statistics.scale, out.map_statistics.scale);
  EXPECT_EQ(in.decoding.spacing_scale, out.decoding.spacing_scale);
  EXPECT_EQ(in.decoding.sh_degree, out.decoding.sh_degree);
  EXPECT_EQ(in.values, out.values);
  EXPECT_EQ(in.pose_statistics.joints, out.pose_statistics.joints);
  EXPECT_TRUE(same(in.pose_statistics.mean, out.pose_statistics.mean));
  EXPECT_TRUE(same(in.pose_statistics.covariance, out.pose_statistics.covariance));
  EXPECT_TRUE(same(in.golden.rotations, out.golden.rotations));
  EXPECT_EQ(in.golden.root_translation_m, out.golden.root_translation_m);
  EXPECT_EQ(in.golden.camera.view_from_world, out.golden.camera.view_from_world);
  EXPECT_EQ(opened.package.required_features(), 0u);
  EXPECT_EQ(opened.package.budget().macs_per_frame, sample.budget.macs_per_frame);
  EXPECT_EQ(opened.package.provenance().licence_name, "CC0-1.0");
}

TEST(SamplerRoundTrip, KeepsTheSpaceTheDenoiserAndHowItIsSampled) {
  const SamplerSample sample;
  const Opened opened = open_or_die(sample.write());
  const Sampler &in = sample.sampler, &out = opened.package.sampler();
  EXPECT_EQ(in.ranks, out.ranks);
  EXPECT_TRUE(same(in.mean, out.mean));
  EXPECT_TRUE(same(in.directions, out.directions));
  EXPECT_TRUE(same(in.direction_scale, out.direction_scale));
  EXPECT_EQ(in.denoiser.d_model, out.denoiser.d_model);
  EXPECT_EQ(in.denoiser.blocks, out.denoiser.blocks);
  EXPECT_EQ(in.denoiser.heads, out.denoiser.heads);
  EXPECT_EQ(in.denoiser.feed_forward, out.denoiser.feed_forward);
  EXPECT_TRUE(same(in.matrices, out.matrices));
  EXPECT_TRUE(same(in.row_scale, out.row_scale));
  EXPECT_TRUE(same(in.bias, out.bias));
  EXPECT_TRUE(same(in.position, out.position));
  EXPECT_TRUE(same(in.norm, out.norm));
  EXPECT_EQ(in.noise.dimension, out.noise.dimension);
  EXPECT_EQ(in.noise.noisy_dimension_snr, out.noise.noisy_dimension_snr);
  EXPECT_EQ(in.noise.decided_dimension_snr, out.noise.decided_dimension_snr);
  EXPECT_EQ(in.noise.clean_snr, out.noise.clean_snr);
  EXPECT_EQ(in.noise.band_share, out.noise.band_share);
  EXPECT_EQ(in.steps, out.steps);
  EXPECT_EQ(in.method, out.method);
  ASSERT_EQ(out.golden_seeds.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(in.golden_seeds[i].seed, out.golden_seeds[i].seed);
    EXPECT_EQ(in.golden_seeds[i].steps, out.golden_seeds[i].steps);
    EXPECT_EQ(in.golden_seeds[i].method, out.golden_seeds[i].method);
    EXPECT_EQ(in.golden_seeds[i].hash, out.golden_seeds[i].hash);
  }
  EXPECT_EQ(in.population_hash, out.population_hash);
  EXPECT_EQ(in.report, out.report);
}

TEST(SamplerRoundTrip, OptionalPartsMayBeAbsent) {
  SamplerSample sample;
  sample.sampler.pose_statistics = {};
  sample.sampler.golden = {};
  sample.sampler.golden_seeds.clear();
  sample.sampler.report = {};
  const Opened opened = open_or_die(sample.write());
  EXPECT_TRUE(opened.package.sampler().pose_statistics.joints.empty());
  EXPECT_TRUE(opened.package.sampler().golden.rotations.empty());
  EXPECT_TRUE(opened.package.sampler().golden_seeds.empty());
  EXPECT_TRUE(opened.package.sampler().report.empty());
}

TEST(SamplerRoundTrip, WithoutAShapeThereIsOneTokenLess) {
  SamplerSample sample;
  Sampler& sampler = sample.sampler;
  sampler.shape_count = 0;
  EXPECT_EQ(sampler.ranks.back(), 2u);
  sampler.ranks.pop_back();
  sampler.mean = sampler.mean.first(853);
  sampler.directions = sampler.directions.first(sampler.directions.size() - size_t{2} * 2);
  sampler.direction_scale = sampler.direction_scale.first(sampler.direction_scale.size() - 2);
  const size_t rows = sampler.bias.size() - 8 - 2,
               bytes = sampler.matrices.size() - size_t{2} * 2 * 8;  // proj [8,2] and unproj [2,8]
  sampler.row_scale = sampler.row_scale.first(rows);
  sampler.bias = sampler.bias.first(rows);
  sampler.matrices = sampler.matrices.first(bytes);
  sampler.position = sampler.position.first(size_t{16} * 8);
  const Opened opened = open_or_die(sample.write());
  EXPECT_EQ(sampler_token_sizes(opened.package.sampler()).size(), 15u);
}

TEST(SamplerRoundTrip, SameInputGivesSameBytes) {
  EXPECT_EQ(*SamplerSample().write(), *SamplerSample().write());
}

// ---- Hash of weights ----------------------------------------------------------------------------

struct HashedWeights {
  std::vector<int8_t> first_weights = {1, 2, 3, 4}, second_weights = {5, 6};
  std::vector<float> first_scale = {0.5f, 0.25f}, second_scale = {2}, shape = {0.5f, -1};
  std::vector<int32_t> first_bias = {7, 8}, second_bias = {9};

  std::array<uint64_t, 2> hash() const {
    FixedPointNetwork fixed;
    fixed.convolutions = {
        {first_weights, first_scale, first_bias}, {}, {second_weights, second_scale, second_bias}};
    return hash_weights(fixed, shape);
  }
};

template <class T>
void expect_every_byte_counts(HashedWeights& weights, std::vector<T>& values,
                              std::set<std::array<uint64_t, 2>>& seen) {
  for (std::byte& byte : std::as_writable_bytes(std::span(values))) {
    byte ^= std::byte{1};
    EXPECT_TRUE(seen.insert(weights.hash()).second);
    byte ^= std::byte{1};
  }
}

TEST(HashWeights, ChangesWithEveryByte) {
  HashedWeights weights;
  std::set<std::array<uint64_t, 2>> seen = {weights.hash()};
  expect_every_byte_counts(weights, weights.first_weights, seen);
  expect_every_byte_counts(weights, weights.first_scale, seen);
  expect_every_byte_counts(weights, weights.first_bias, seen);
  expect_every_byte_counts(weights, weights.second_weights, seen);
  expect_every_byte_counts(weights, weights.second_scale, seen);
  expect_every_byte_counts(weights, weights.second_bias, seen);
  expect_every_byte_counts(weights, weights.shape, seen);
  EXPECT_EQ(seen.size(), 1u + 6 + 4 * (3 + 3 + 2));
  EXPECT_EQ(weights.hash(), HashedWeights().hash());
}

TEST(HashWeights, ChangesWithTheOrder) {
  const std::array<uint64_t, 2> sound = HashedWeights().hash();
  HashedWeights swapped;
  std::swap(swapped.first_weights[0], swapped.first_weights[1]);
  EXPECT_NE(swapped.hash(), sound);
  HashedWeights exchanged;
  std::swap(exchanged.first_weights, exchanged.second_weights);
  std::swap(exchanged.first_scale, exchanged.second_scale);
  std::swap(exchanged.first_bias, exchanged.second_bias);
  EXPECT_NE(exchanged.hash(), sound);
  HashedWeights shapeless;
  shapeless.shape.clear();
  EXPECT_NE(shapeless.hash(), sound);
}

TEST(HashWeights, IsOneHashOfAllBytesInTheirOrder) {
  const HashedWeights weights;
  std::vector<uint8_t> bytes;
  const auto append = [&](const auto& values) {
    for (const std::byte byte : std::as_bytes(std::span(values)))
      bytes.push_back(static_cast<uint8_t>(byte));
  };
  append(weights.first_weights), append(weights.first_scale), append(weights.first_bias);
  append(weights.second_weights), append(weights.second_scale), append(weights.second_bias);
  append(weights.shape);
  EXPECT_EQ(weights.hash(), hash_picture(bytes));
  // By value, so that it cannot drift: files in the field carry it.
  EXPECT_EQ(format_hash(weights.hash()), "0ba82d4283e7ebed844adfb576265c1f");
}

// ---- The writer ---------------------------------------------------------------------------------

// The status of writing a sample after something was done to it.
Status bent(const std::function<void(SamplerSample&)>& bend) {
  SamplerSample sample;
  bend(sample);
  return sample.write().status();
}

TEST(SamplerWriter, LeavesOutAPictureAndAHash) {
  SamplerSample sample;
  const samples::AvatarSample avatar;
  sample.sampler.golden.png = avatar.golden_png;
  sample.sampler.golden.fixed_point_hash = {1, 2};
  sample.sampler.golden.fixed_point_library = "library";
  EXPECT_EQ(*sample.write(), *SamplerSample().write());
}

TEST(SamplerWriter, RejectsArraysThatFitNoShape) {
  constexpr StatusCode kInvalid = StatusCode::kInvalidArgument;
  const auto refused = [](const std::string& words, const std::function<void(Sampler&)>& bend) {
    expect_refused(bent([&](SamplerSample& s) { bend(s.sampler); }),
                   "sampler 'sample sampler': " + words, kInvalid);
  };
  refused("network: layer 0: kernel", [](Sampler& s) { s.network.layers[0].kernel = 2; });
  refused("sampler.ranks: has 15 entries for 16 tokens", [](Sampler& s) { s.ranks.pop_back(); });
  refused("sampler.ranks: has 16 entries for 15 tokens", [](Sampler& s) { s.shape_count = 0; });
  refused("sampler.denoiser.blocks", [](Sampler& s) { s.denoiser.blocks = UINT32_MAX; });
  refused("space.mean", [](Sampler& s) { s.mean = s.mean.first(854); });
  refused("space.directions", [](Sampler& s) { s.directions = s.directions.first(7); });
  refused("space.direction_scale", [](Sampler& s) { s.direction_scale = {}; });
  refused("denoiser.matrices", [](Sampler& s) { s.denoiser.feed_forward = 13; });
  refused("denoiser.row_scale", [](Sampler& s) { s.row_scale = s.row_scale.first(9); });
  refused("denoiser.bias", [](Sampler& s) { s.bias = s.bias.first(9); });
  refused("denoiser.position", [](Sampler& s) { s.position = s.position.first(16); });
  refused("denoiser.norm", [](Sampler& s) { s.norm = s.norm.first(16); });
  refused("pose.mean", [](Sampler& s) { s.pose_statistics.joints = {1, 2}; });
  refused("golden.rotations",
          [](Sampler& s) { s.golden.rotations = s.golden.rotations.first(11); });
}

// ---- Numbers that cannot be true ----------------------------------------------------------------

// The status of a sampler after something was done to the parts that it is assembled from.
Status bent_parts(const std::function<void(PackageParts&, Sampler&)>& bend) {
  SamplerSample sample;
  PackageParts parts = *take_apart(sample.sampler, sample.budget, samples::make_provenance());
  bend(parts, sample.sampler);
  const ExactBytes bytes(assemble(parts));
  return Package::open(bytes.bytes(), "bent.fgn").status();
}

// Its index says something else than its blobs were made for.
Status with_index(const std::function<void(Sampler&)>& bend) {
  return bent_parts([&](PackageParts&, Sampler& sampler) { bend(sampler); });
}

// A blob with its bytes changed, or of another shape or type.
Status with_blob(const std::string& name,
                 const std::function<void(BlobPart&, std::vector<std::byte>&)>& bend) {
  std::vector<std::byte> bytes;
  return bent_parts([&](PackageParts& parts, Sampler&) {
    const auto blob = std::ranges::find(parts.blobs, name, &BlobPart::name);
    FIG_CHECK(blob != parts.blobs.end(), name.c_str());
    bytes.assign(blob->bytes.begin(), blob->bytes.end());
    bend(*blob, bytes);
    blob->bytes = bytes;
  });
}

template <class T>
Status with_value(const std::string& name, size_t index, T value) {
  return with_blob(name, [&](BlobPart&, std::vector<std::byte>& bytes) {
    std::memcpy(bytes.data() + index * sizeof(T), &value, sizeof(T));
  });
}

TEST(PackageSampler, IsSoundBeforeItIsBent) {
  EXPECT_TRUE(with_index([](Sampler&) {}).ok());
  EXPECT_TRUE(with_value("space.mean", 0, 0.5f).ok());
  EXPECT_TRUE(with_value<int8_t>("space.directions", 0, -127).ok());
  EXPECT_TRUE(with_value("denoiser.row_scale", 0, std::numeric_limits<float>::min()).ok());
}

TEST(PackageSampler, RejectsFloatsThatAreNotFiniteOrTooLarge) {
  for (const char* name : {"space.mean", "space.direction_scale", "denoiser.row_scale",
                           "denoiser.bias", "denoiser.position", "denoiser.norm"}) {
    for (const float value : {kNan, kInfinity, -kInfinity}) {
      expect_refused(with_value(name, 3, value), std::string(name) + ": value 3 is not finite");
    }
    expect_refused(with_value(name, 5, 1.5e6f),
                   std::string(name) + ": value 5 is larger than 1000000");
  }
  for (const float value : {kNan, kInfinity}) {
    expect_refused(with_value("pose.mean", 1, value), "pose.mean: value 1 is not finite");
    expect_refused(with_value("golden.rotations", 4, value),
                   "golden: pose: the rotation of joint 1");
  }
}

TEST(PackageSampler, RejectsScalesThatAreNone) {
  expect_refused(with_value("space.direction_scale", 4, -0.5f),
                 "space.direction_scale: value 4 is negative");
  EXPECT_TRUE(with_value("space.direction_scale", 4, 0.0f).ok());
  for (const float value : {0.0f, -1.0f, std::numeric_limits<float>::denorm_min(), 1e-39f}) {
    expect_refused(with_value("denoiser.row_scale", 7, value),
                   "denoiser.row_scale: value 7 is not positive, or too small");
  }
}

TEST(PackageSampler, RejectsWeightsThatAreNotSymmetric) {
  expect_refused(with_value<int8_t>("space.directions", 11, -128),
                 "space.directions: value 11 is -128");
  expect_refused(with_value<int8_t>("denoiser.matrices", 0, -128),
                 "denoiser.matrices: value 0 is -128");
}

TEST(PackageSampler, RejectsBlobsOfOtherShapesAndTypes) {
  const auto reshaped = [](const std::string& name, const std::vector<uint32_t>& shape) {
    return with_blob(name, [&](BlobPart& blob, std::vector<std::byte>& bytes) {
      blob.shape = shape;
      uint64_t size = size_bytes(blob.type);
      for (const uint32_t length : shape) size *= length;
      bytes.resize(size);
    });
  };
  const SamplerSample sample;
  const auto one_less = [&](const std::string& name, size_t size) {
    expect_refused(reshaped(name, {static_cast<uint32_t>(size - 1)}),
                   name + ": has shape [" + std::to_string(size - 1) + "], expected [" +
                       std::to_string(size) + "]");
  };
  one_less("space.mean", 855);
  one_less("space.directions", sample.directions.size());
  one_less("space.direction_scale", 24);
  one_less("denoiser.matrices", sample.matrices.size());
  one_less("denoiser.row_scale", sample.row_scale.size());
  one_less("denoiser.bias", sample.bias.size());
  expect_refused(reshaped("space.directions", {1, static_cast<uint32_t>(sample.directions.size())}),
                 "space.directions: has shape [1,");
  expect_refused(reshaped("denoiser.position", {16, 8}),
                 "denoiser.position: has shape [16,8], expected [17,8]");
  expect_refused(reshaped("denoiser.norm", {4, 2, 8}),
                 "denoiser.norm: has shape [4,2,8], expected [5,2,8]");
  expect_refused(reshaped("denoiser.norm", {5, 16}), "denoiser.norm: has shape [5,16]");
  expect_refused(reshaped("pose.covariance", {9}), "pose.covariance: has shape [9]");
  expect_refused(reshaped("golden.rotations", {12}), "golden.rotations: has shape [12]");
  for (const char* name : {"space.directions", "denoiser.matrices"}) {
    expect_refused(
        with_blob(name, [](BlobPart& blob, std::vector<std::byte>&) { blob.type = DataType::kU8; }),
        std::string(name) + ": is u8, not i8");
  }
  for (const char* name :
       {"space.mean", "space.directions", "space.direction_scale", "denoiser.matrices",
        "denoiser.row_scale", "denoiser.bias", "denoiser.position", "denoiser.norm", "pose.mean",
        "pose.covariance", "golden.rotations"}) {
    expect_refused(bent_parts([&](PackageParts& parts, Sampler&) {
                     std::erase_if(parts.blobs,
                                   [&](const BlobPart& blob) { return blob.name == name; });
                   }),
                   std::string(name) + ": is missing");
  }
}

TEST(PackageSampler, RejectsTokensWithoutTheirDirections) {
  expect_refused(with_index([](Sampler& s) { s.ranks.pop_back(); }),
                 "sampler.ranks: has 15 entries for 16 tokens");
  expect_refused(with_index([](Sampler& s) { s.ranks.push_back(1); }),
                 "sampler.ranks: has 17 entries for 16 tokens");
  expect_refused(with_index([](Sampler& s) { s.shape_count = 0; }),
                 "sampler.ranks: has 16 entries for 15 tokens");
  for (const uint32_t rank : {0u, kMaxDenoiserWidth + 1, UINT32_MAX}) {
    expect_refused(with_index([&](Sampler& s) { s.ranks[4] = rank; }),
                   "sampler.ranks: token 4 has " + std::to_string(rank));
  }
  expect_refused(with_index([](Sampler& s) { s.ranks[4] = 2; }), "space.directions: has shape");
  expect_refused(with_index([](Sampler& s) { s.shape_count = 65; }),
                 "sampler.shape_count: is above 64", StatusCode::kLimitExceeded);
  expect_refused(with_index([](Sampler& s) { s.shape_count = 3; }),
                 "space.mean: has shape [855], expected [856]");
}

TEST(PackageSampler, RejectsDenoisersThatCannotBe) {
  for (const uint32_t value : {0u, kMaxDenoiserWidth + 4, UINT32_MAX - 3}) {
    expect_refused(with_index([&](Sampler& s) { s.denoiser.d_model = value; }),
                   "sampler.denoiser.d_model: is not 1 to 4096");
    expect_refused(with_index([&](Sampler& s) { s.denoiser.feed_forward = value; }),
                   "sampler.denoiser.feed_forward: is not 1 to 4096");
  }
  for (const uint32_t value : {0u, kMaxDenoiserBlocks + 1, UINT32_MAX}) {
    expect_refused(with_index([&](Sampler& s) { s.denoiser.blocks = value; }),
                   "sampler.denoiser.blocks: is not 1 to 64");
  }
  for (const uint32_t value :
       {0u, 3u, 8u, 1u << 31, UINT32_MAX}) {  // twice 2^31 is none in 32 bits
    expect_refused(with_index([&](Sampler& s) { s.denoiser.heads = value; }),
                   "sampler.denoiser.heads: is " + std::to_string(value));
  }
  expect_refused(with_index([](Sampler& s) { s.denoiser.d_model = 6; }),
                 "sampler.denoiser.heads: is 2, of which two");
  EXPECT_TRUE(with_index([](Sampler& s) { s.denoiser.heads = 4; }).ok());
  expect_refused(with_index([](Sampler& s) { s.denoiser.d_model = 12; }),
                 "denoiser.matrices: has shape");
  expect_refused(with_index([](Sampler& s) { s.denoiser.blocks = 3; }),
                 "denoiser.matrices: has shape");
}

TEST(PackageSampler, RejectsSizesBeyond32Bits) {
  // 17 convolutions of 1024 x 1024 x 9 values and 256 directions each: 4.1e10 bytes of directions
  // from a list of layers.
  const auto wide = [](Sampler& s, size_t convolutions, uint32_t rank) {
    s.network.layers.clear();
    s.values.assign(convolutions + 1, {.scale = 0.125f, .zero_point = 0});
    for (uint32_t i = 0; i < convolutions; ++i) {
      s.network.layers.push_back(
          {.op = LayerOp::kConv2d, .inputs = {i, 0}, .out_channels = 1024, .kernel = 3});
    }
    s.network.layers.push_back({.op = LayerOp::kConv2d,
                                .inputs = {static_cast<uint32_t>(convolutions), 0},
                                .out_channels = head_channels(1),
                                .kernel = 1});
    s.ranks.assign(convolutions + 2, rank);
  };
  const auto opened = [](const std::function<void(Sampler&)>& bend) {
    return bent_parts([&](PackageParts& parts, Sampler& sampler) {
      parts.budget = {};
      bend(sampler);
    });
  };
  expect_refused(opened([&](Sampler& s) { wide(s, 17, 256); }),
                 "space.directions: would have more than 2^32 values", StatusCode::kLimitExceeded);
  const auto widest =
      [](Sampler& s) {  // 250 convolutions of 4096 x 4096 x 9 values: 3.8e10 of them
        s.network.layers.clear();
        s.values.assign(251, {.scale = 0.125f, .zero_point = 0});
        for (uint32_t i = 0; i < 250; ++i) {
          s.network.layers.push_back(
              {.op = LayerOp::kConv2d, .inputs = {i, 0}, .out_channels = 4096, .kernel = 3});
        }
        s.network.layers.push_back({.op = LayerOp::kConv2d,
                                    .inputs = {250, 0},
                                    .out_channels = head_channels(1),
                                    .kernel = 1});
        s.ranks.assign(252, 1);
      };
  expect_refused(opened(widest), "space.mean: would have more than 2^32 values",
                 StatusCode::kLimitExceeded);
}

TEST(PackageSampler, RejectsAMatrixListBeyond32Bits) {
  // Blocks of the widest denoiser: 64 x (3 + 1 + 1 + 1) x 4096^2 bytes. The position blob is never
  // looked at.
  const auto widest = [](Sampler& s) {
    s.denoiser = {.d_model = 4096, .blocks = 64, .heads = 1, .feed_forward = 4096};
  };
  expect_refused(with_index(widest), "denoiser.matrices: would have more than 2^32 values",
                 StatusCode::kLimitExceeded);
}

TEST(PackageSampler, RejectsQuantisationWhoseArithmeticIsNotDefined) {
  for (const float scale :
       {0.0f, -0.125f, kNan, kInfinity, std::numeric_limits<float>::denorm_min()}) {
    expect_refused(with_index([&](Sampler& s) { s.values[1].scale = scale; }),
                   "sampler.values: fixed point: value 1: the scale");
  }
  expect_refused(with_index([](Sampler& s) { s.values[1].zero_point = 128; }),
                 "sampler.values: fixed point: value 1: the zero point");
  expect_refused(with_index([](Sampler& s) { s.values[0].zero_point = 1; }),
                 "sampler.values: fixed point: value 0: the zero point");
  expect_refused(with_index([](Sampler& s) { s.values[3].scale = 0.25f; }),
                 "do not share one quantisation");
  expect_refused(with_index([](Sampler& s) { s.values.pop_back(); }),
                 "sampler.values: fixed point: not one entry per layer");
  expect_refused(with_index([](Sampler& s) { s.values.clear(); }),
                 "sampler.values: fixed point: not one entry per layer");
  expect_refused(with_index([](Sampler& s) { s.values.resize(kMaxLayers + 1); }),
                 "sampler.values: has more than 256", StatusCode::kLimitExceeded);
  expect_refused(with_index([](Sampler& s) { s.network.layers.back().relu = true; }),
                 "without ReLU");
}

TEST(PackageSampler, RejectsNetworksAndBudgetsThatCannotBe) {
  expect_refused(with_index([](Sampler& s) { s.network.layers[3].inputs[0] = 20; }),
                 "network: layer 3: input is not an earlier value");
  expect_refused(with_index([](Sampler& s) { s.network.layers.clear(); }),
                 "network: number of layers");
  expect_refused(bent_parts([](PackageParts& parts, Sampler& s) {
                   parts.budget = {};
                   s.network.layers[0].out_channels = 3;
                 }),
                 "space.mean: has shape");
  expect_refused(with_index([](Sampler& s) { s.fourier_octaves = 2; }),
                 "maps and Fourier channels make 14");
  expect_refused(with_index([](Sampler& s) { s.fourier_octaves = 13; }), "sampler.fourier_octaves",
                 StatusCode::kLimitExceeded);
  expect_refused(with_index([](Sampler& s) { s.decoding.sh_degree = 0; }), "the head needs 14");
  expect_refused(
      bent_parts([](PackageParts& parts, Sampler&) { parts.budget.macs_per_frame -= 1; }),
      "budget.macs_per_frame", StatusCode::kLimitExceeded);
  expect_refused(
      bent_parts([](PackageParts& parts, Sampler&) { parts.budget.peak_memory_bytes = 100; }),
      "budget.peak_memory_bytes", StatusCode::kLimitExceeded);
  expect_refused(bent_parts([](PackageParts& parts, Sampler&) { parts.budget.gaussians = 65; }),
                 "budget.gaussians");
}

TEST(PackageSampler, RejectsSharedFieldsThatCannotBe) {
  expect_refused(with_index([](Sampler& s) { s.name = "two\nlines"; }), "sampler.name");
  expect_refused(with_index([](Sampler& s) { s.body_name = std::string(257, 'a'); }),
                 "sampler.body_name", StatusCode::kLimitExceeded);
  expect_refused(with_index([](Sampler& s) { s.preset = "\xFF"; }), "sampler.preset");
  expect_refused(with_index([](Sampler& s) { s.template_mode = static_cast<TemplateMode>(2); }),
                 "sampler.template_mode", StatusCode::kUnsupported);
  expect_refused(with_index([](Sampler& s) { s.map_statistics.scale[2] = 0; }),
                 "sampler.map_statistics: channel 2");
  expect_refused(with_index([](Sampler& s) { s.decoding.offset_scale_m = kNan; }),
                 "sampler.decoding.offset_scale_m");
  expect_refused(with_index([](Sampler& s) { s.decoding.opacity_bias = kInfinity; }),
                 "sampler.decoding.opacity_bias");
  expect_refused(with_index([](Sampler& s) { s.pose_statistics.joints = {2, 2}; }),
                 "sampler.pose_statistics.joints: lists a joint twice");
  expect_refused(with_index([](Sampler& s) { s.pose_statistics.joints = {1, 2}; }),
                 "pose.mean: has shape [3], expected [6]");
  expect_refused(with_value("pose.covariance", 8, -1.0f),
                 "pose.covariance: row 2: the variance is not positive");
  expect_refused(with_index([](Sampler& s) { s.golden.camera.fx_px = 0; }),
                 "golden: camera: focal lengths");
  expect_refused(with_index([](Sampler& s) { s.golden.background[0] = 2; }), "golden.background");
}

TEST(PackageSampler, RejectsAGoldenFrameThatIsOfOneAvatar) {
  expect_refused(with_index([](Sampler& s) { s.golden.fixed_point_hash[1] = 1; }),
                 "golden.fixed_point_hash: is there");
  expect_refused(with_index([](Sampler& s) { s.golden.fixed_point_library = "library"; }),
                 "golden.fixed_point_library: is there");
  const samples::AvatarSample avatar;
  expect_refused(
      bent_parts([&](PackageParts& parts, Sampler&) {
        const auto png = std::as_bytes(std::span(avatar.golden_png));
        parts.blobs.push_back(
            {"golden.png", DataType::kU8, {static_cast<uint32_t>(png.size())}, png, false});
      }),
      "golden.png: is there, a sampler has no picture");
}

TEST(PackageSampler, RejectsSchedulesAndStepsThatNoSolverTakes) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused(with_index([](Sampler& s) { s.noise.dimension = 0; }),
                 "sampler.noise: noise schedule: dimension");
  for (const double value : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()}) {
    expect_refused(with_index([&](Sampler& s) { s.noise.noisy_dimension_snr = value; }),
                   "sampler.noise: noise schedule: a signal-to-noise");
    expect_refused(with_index([&](Sampler& s) { s.noise.decided_dimension_snr = value; }),
                   "sampler.noise: noise schedule: a signal-to-noise");
    expect_refused(with_index([&](Sampler& s) { s.noise.clean_snr = value; }),
                   "sampler.noise: noise schedule: a signal-to-noise");
  }
  for (const double value : {-0.5, 1.0, nan}) {
    expect_refused(with_index([&](Sampler& s) { s.noise.band_share = value; }),
                   "sampler.noise: noise schedule: band_share");
  }
  expect_refused(with_index([](Sampler& s) { s.noise.noisy_dimension_snr = 1e9; }),
                 "sampler.noise: noise schedule: the noisy end");
  for (const uint32_t steps : {0u, uint32_t{kMaxSolverSteps} + 1, UINT32_MAX}) {
    expect_refused(with_index([&](Sampler& s) { s.steps = steps; }),
                   "sampler.steps: is " + std::to_string(steps));
    expect_refused(with_index([&](Sampler& s) { s.golden_seeds[1].steps = steps; }),
                   "sampler.golden_seeds[1].steps: is " + std::to_string(steps));
  }
  expect_refused(with_index([](Sampler& s) { s.method = static_cast<SolverMethod>(2); }),
                 "sampler.method: is unknown", StatusCode::kUnsupported);
  expect_refused(
      with_index([](Sampler& s) { s.golden_seeds[0].method = static_cast<SolverMethod>(2); }),
      "sampler.golden_seeds[0].method: is unknown", StatusCode::kUnsupported);
  expect_refused(with_index([](Sampler& s) { s.golden_seeds.resize(1025); }),
                 "sampler.golden_seeds: has more than 1024", StatusCode::kLimitExceeded);
}

TEST(PackageSampler, RejectsReportsThatAreNoText) {
  expect_refused(bent([](SamplerSample& s) { s.report = "\xFF", s.sampler.report = s.report; }),
                 "sampler.report: is not UTF-8 text");
  expect_refused(bent([](SamplerSample& s) { s.report = "\x1B[2J", s.sampler.report = s.report; }),
                 "sampler.report: is not UTF-8 text");
  const auto of_bytes = [](size_t bytes) {
    return bent(
        [&](SamplerSample& s) { s.report = std::string(bytes, 'x'), s.sampler.report = s.report; });
  };
  EXPECT_TRUE(of_bytes(256u << 10).ok());
  expect_refused(of_bytes((256u << 10) + 1), "sampler.report: is longer than 262144 bytes",
                 StatusCode::kLimitExceeded);
}

TEST(PackageSampler, SkipsUnknownOptionalBlobsAndRefusesOthersAndFeatures) {
  const uint32_t value = 1;
  for (const bool optional : {true, false}) {
    const Status status = bent_parts([&](PackageParts& parts, Sampler&) {
      parts.blobs.push_back(
          {"space.range", DataType::kU32, {1}, std::as_bytes(std::span(&value, 1)), optional});
    });
    EXPECT_EQ(status.ok(), optional) << status.message();
  }
  expect_refused(bent_parts([](PackageParts& parts, Sampler&) {
                   parts.required_features = kFeatureFixedPoint;
                 }),
                 "header.required_features");
}

}  // namespace
}  // namespace figurine::package_sampler_test
