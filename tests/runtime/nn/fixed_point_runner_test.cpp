// The device's evaluation in fixed point against its definition: every value, every texel, the same
// bits.
#include "runtime/src/nn/fixed_point_runner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include "runtime/nn/fixed_point_networks.h"

namespace figurine::fixed_point_runner_test {
namespace {

using tests::RandomFixedPointNetwork;

std::vector<uint32_t> all_texels(uint32_t size) {
  std::vector<uint32_t> texels(size_t{size} * size);
  std::iota(texels.begin(), texels.end(), 0u);
  return texels;
}

// An input with its last channels held constant, as a pose's maps and Fourier channels are.
struct Scenario {
  uint32_t constant_channels = 0;
  std::vector<uint32_t> drawn, wanted;  // empty: all
  uint64_t seed = 5;
  uint32_t threads = 1;
};

struct Input {
  std::vector<float> varying, constants;
  std::vector<int16_t> quantised;  // as the definition wants it
};

Input make_input(const RandomFixedPointNetwork& random, const Scenario& scenario, uint64_t seed) {
  const uint32_t channels = random.network.input_channels,
                 varying = channels - scenario.constant_channels;
  const size_t texels = size_t{random.network.input_size} * random.network.input_size;
  Input input{.varying = random.input(seed, varying),
              .constants = random.input(99, scenario.constant_channels),
              .quantised = {}};
  if (!scenario.drawn.empty()) {
    std::vector<uint8_t> drawn(texels, 0);
    for (const uint32_t texel : scenario.drawn) drawn[texel] = 1;
    for (size_t i = 0; i < input.varying.size(); ++i) input.varying[i] *= drawn[i / varying];
  }
  for (size_t texel = 0; texel < texels; ++texel) {
    for (uint32_t c = 0; c < channels; ++c) {
      const float value = c < varying
                              ? input.varying[texel * varying + c]
                              : input.constants[texel * scenario.constant_channels + (c - varying)];
      input.quantised.push_back(quantise_input(value, random.fixed.values[0].scale));
    }
  }
  return input;
}

void set_input(FixedPointRunner& runner, const std::vector<float>& varying, uint32_t channels) {
  for (size_t i = 0; i < varying.size(); ++i)
    runner.input()[i / channels * runner.input_stride() + i % channels] = varying[i];
}

void expect_equal(const std::vector<float>& result, std::span<const uint32_t> wanted,
                  std::span<const float> output, uint32_t channels) {
  ASSERT_EQ(output.size(), wanted.size() * channels);
  for (size_t i = 0; i < wanted.size(); ++i) {
    ASSERT_EQ(std::memcmp(&output[i * channels], &result[size_t{wanted[i]} * channels],
                          channels * sizeof(float)),
              0)
        << "texel " << wanted[i] << ": " << output[i * channels] << " should be "
        << result[size_t{wanted[i]} * channels];
  }
}

// Two runs of one runner, each equal to the definition.
void expect_definition(const RandomFixedPointNetwork& random, Scenario scenario) {
  const uint32_t channels = random.shapes.back().channels,
                 varying = random.network.input_channels - scenario.constant_channels;
  const std::vector<uint32_t> drawn = scenario.drawn.empty() ? all_texels(random.network.input_size)
                                                             : scenario.drawn,
                              wanted = scenario.wanted.empty()
                                           ? all_texels(random.shapes.back().size)
                                           : scenario.wanted;
  Result<ThreadPool> pool = ThreadPool::create(scenario.threads);
  ASSERT_TRUE(pool.ok());
  const std::vector<float> constants = make_input(random, scenario, scenario.seed).constants;
  Result<std::unique_ptr<FixedPointRunner>> runner = FixedPointRunner::create(
      random.network, random.fixed,
      {.varying_channels = varying, .constants = constants, .drawn = drawn, .wanted = wanted},
      *pool);
  ASSERT_TRUE(runner.ok()) << runner.status().message();
  for (uint64_t run = 0; run < 2; ++run) {
    const Input input = make_input(random, scenario, scenario.seed + run);
    set_input(**runner, input.varying, varying);
    ASSERT_TRUE((*runner)->run().ok());
    const FixedPointValues truth =
        evaluate_fixed_point(random.network, random.fixed, input.quantised);
    expect_equal(truth.result, wanted, (*runner)->output(), channels);
  }
}

// How much of the int8 values lies strictly inside the range: a network of saturated values would
// prove little.
double share_inside(const RandomFixedPointNetwork& random) {
  const Input input = make_input(random, {}, 5);
  const FixedPointValues truth =
      evaluate_fixed_point(random.network, random.fixed, input.quantised);
  size_t inside = 0, total = 0;
  for (size_t value = 1; value < truth.values.size(); ++value) {
    total += truth.values[value].size();
    inside += size_t(std::ranges::count_if(truth.values[value], [&](int8_t q) {
      return q > kInt8Min && q < kInt8Max && q != random.fixed.values[value].zero_point;
    }));
  }
  return static_cast<double>(inside) / static_cast<double>(total);
}

TEST(FixedPointRunner, NanoEqualsTheDefinition) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const RandomFixedPointNetwork random(make_pose_unet(32, 26, 8, head_channels(0)), seed);
    EXPECT_GT(share_inside(random), 0.2);  // ReLU alone takes half of them
    expect_definition(random, {.constant_channels = 20});
  }
}

TEST(FixedPointRunner, EdgeEqualsTheDefinition) {
  // At half its side; the golden frames hold it at 128.
  expect_definition(RandomFixedPointNetwork(make_pose_unet(64, 26, 32, head_channels(0)), 3),
                    {.constant_channels = 20, .threads = 2});
}

TEST(FixedPointRunner, PaperChannelsEqualTheDefinition) {
  expect_definition(RandomFixedPointNetwork(make_pose_unet(32, 6, 64, head_channels(3)), 2), {});
}

TEST(FixedPointRunner, AnySizeEqualsTheDefinition) {
  // T = 8: the lowest resolution is a single pixel. Channels that are no multiple of any vector.
  for (const uint32_t size : {8u, 16u, 24u, 40u}) {
    for (const uint32_t channels : {1u, 3u, 5u, 17u}) {
      expect_definition(
          RandomFixedPointNetwork(make_pose_unet(size, 6, channels, 14), size + channels), {});
    }
  }
}

TEST(FixedPointRunner, SaturatedValuesEqualTheDefinition) {
  for (const float gain : {4.0f, 100.0f, 1e-3f}) {
    expect_definition(RandomFixedPointNetwork(make_pose_unet(32, 10, 8, 14), 7, gain),
                      {.constant_channels = 4});
  }
}

TEST(FixedPointRunner, ResultsDoNotDependOnThreads) {
  const RandomFixedPointNetwork random(make_pose_unet(64, 26, 16, 14), 4);
  for (const uint32_t threads : {1u, 2u, 3u, 4u})
    expect_definition(random, {.constant_channels = 20, .threads = threads});
}

TEST(FixedPointRunner, OnlyDrawnTexelsNeedToBeEvaluated) {
  // Drawn texels in the corners, at the edges, alone and in a block.
  std::vector<uint32_t> drawn = {0, 31, 32 * 31, 32 * 32 - 1, 15, 32 * 16, 700};
  for (uint32_t v = 8; v < 14; ++v) {
    for (uint32_t u = 3; u < 20; ++u) drawn.push_back(v * 32 + u);
  }
  const RandomFixedPointNetwork random(make_pose_unet(32, 26, 8, 14), 5);
  for (const uint32_t constant_channels : {0u, 20u}) {
    expect_definition(random,
                      {.constant_channels = constant_channels, .drawn = drawn, .threads = 2});
  }
}

TEST(FixedPointRunner, GivesTheWantedTexelsInTheirOrder) {
  expect_definition(RandomFixedPointNetwork(make_pose_unet(32, 6, 8, 14), 6),
                    {.wanted = {1023, 0, 5, 5, 500}});
  std::vector<uint32_t> many = all_texels(32);
  std::ranges::reverse(many);
  expect_definition(RandomFixedPointNetwork(make_pose_unet(32, 6, 8, 14), 6),
                    {.wanted = many, .threads = 3});
}

Layer convolution(uint32_t input, uint32_t out, uint32_t kernel, bool relu = false) {
  return {.op = LayerOp::kConv2d,
          .inputs = {input, 0},
          .out_channels = out,
          .kernel = kernel,
          .relu = relu};
}

TEST(FixedPointRunner, ASingleConvolutionReadsTheInputAndGivesTheResult) {
  for (const uint32_t kernel : {1u, 3u}) {
    const RandomFixedPointNetwork random(
        {.input_size = 5, .input_channels = 10, .layers = {convolution(0, 14, kernel)}}, kernel);
    for (const uint32_t constant_channels : {0u, 4u, 10u})
      expect_definition(random, {.constant_channels = constant_channels});
  }
}

TEST(FixedPointRunner, TwoConvolutionsLeaveNothingForXnnpack) {
  const RandomFixedPointNetwork random(
      {.input_size = 9,
       .input_channels = 6,
       .layers = {convolution(0, 7, 3, true), convolution(1, 3, 3)}});
  expect_definition(random, {});
}

TEST(FixedPointRunner, AnyLayerListIsAllowed) {
  // The input read by three convolutions, one of which nobody needs; values read twice; a result at
  // half the size.
  const RandomFixedPointNetwork random(
      {.input_size = 12,
       .input_channels = 9,
       .layers = {convolution(0, 7, 3, true),                     // 1
                  convolution(0, 5, 1),                           // 2
                  convolution(0, 4, 3),                           // 3, needed by nobody
                  {.op = LayerOp::kConcat, .inputs = {1, 2}},     // 4
                  {.op = LayerOp::kMaxPool2, .inputs = {4, 0}},   // 5
                  {.op = LayerOp::kUpsample2, .inputs = {5, 0}},  // 6
                  {.op = LayerOp::kConcat, .inputs = {6, 1}},     // 7
                  convolution(7, 6, 3, true),                     // 8
                  {.op = LayerOp::kMaxPool2, .inputs = {8, 0}},   // 9
                  convolution(9, 2, 3)}},
      11);
  expect_definition(random, {.constant_channels = 4, .threads = 2});
}

TEST(FixedPointRunner, WhatIsNoNumberClampsAsItIsDefined) {
  const RandomFixedPointNetwork random(make_pose_unet(8, 6, 3, 14), 8);
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  const std::vector<uint32_t> texels = all_texels(8);
  Result<std::unique_ptr<FixedPointRunner>> runner = FixedPointRunner::create(
      random.network, random.fixed,
      {.varying_channels = 6, .constants = {}, .drawn = texels, .wanted = texels}, *pool);
  ASSERT_TRUE(runner.ok());
  constexpr float kOdd[] = {1e30f,
                            -1e30f,
                            std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN(),
                            -0.0f,
                            std::numeric_limits<float>::denorm_min()};
  std::vector<float> varying(8 * 8 * 6);
  std::vector<int16_t> quantised;
  for (size_t i = 0; i < varying.size(); ++i) {
    varying[i] = kOdd[i % std::size(kOdd)];
    quantised.push_back(quantise_input(varying[i], random.fixed.values[0].scale));
  }
  EXPECT_EQ(quantised[0], kInputMax);
  EXPECT_EQ(quantised[4], -kInputMax) << "NaN is the lowest value";
  set_input(**runner, varying, 6);
  ASSERT_TRUE((*runner)->run().ok());
  expect_equal(evaluate_fixed_point(random.network, random.fixed, quantised).result, texels,
               (*runner)->output(), 14);
}

TEST(FixedPointRunner, WeightsAreNotReadAfterCreation) {
  RandomFixedPointNetwork random(make_pose_unet(16, 6, 4, 14), 9);
  const Input input = make_input(random, {}, 1);
  const std::vector<float> truth =
      evaluate_fixed_point(random.network, random.fixed, input.quantised).result;
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  const std::vector<uint32_t> texels = all_texels(16);
  Result<std::unique_ptr<FixedPointRunner>> runner = FixedPointRunner::create(
      random.network, random.fixed,
      {.varying_channels = 6, .constants = {}, .drawn = texels, .wanted = texels}, *pool);
  ASSERT_TRUE(runner.ok());
  for (std::vector<int8_t>& values : random.weights) std::ranges::fill(values, int8_t{1});
  for (std::vector<float>& values : random.scales) std::ranges::fill(values, 1.0f);
  for (std::vector<int32_t>& values : random.biases) std::ranges::fill(values, 1);
  set_input(**runner, input.varying, 6);
  ASSERT_TRUE((*runner)->run().ok());
  expect_equal(truth, texels, (*runner)->output(), 14);
}

TEST(FixedPointRunner, RefusesNetworksThatAreNotDefined) {
  RandomFixedPointNetwork random(make_pose_unet(16, 6, 4, 14));
  random.fixed.values[3].scale = 0;
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  const auto runner =
      FixedPointRunner::create(random.network, random.fixed, {.varying_channels = 6}, *pool);
  ASSERT_FALSE(runner.ok());
  EXPECT_EQ(runner.status().code(), StatusCode::kCorrupt);
}

}  // namespace
}  // namespace figurine::fixed_point_runner_test
