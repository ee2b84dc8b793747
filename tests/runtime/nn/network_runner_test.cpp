// XNNPACK's network equals the definition, for presets and for layer lists that no preset has.
#include "runtime/src/nn/network_runner.h"

#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <vector>

#include "largest_error.h"
#include "runtime/nn/reference_network.h"
#include "runtime/test_packages.h"

namespace figurine::network_runner_test {
namespace {

using tests::Random;

// A network with random weights and the storage behind them.
struct RandomNetwork {
  Network network;
  std::vector<ValueShape> shapes;
  std::deque<std::vector<float>> storage;

  explicit RandomNetwork(Network bare, uint64_t seed = 1) : network(std::move(bare)) {
    Random random(seed);
    shapes = *infer_shapes(network, false);
    for (Layer& layer : network.layers) {
      if (layer.op != LayerOp::kConv2d) continue;
      const uint32_t fan_in = layer.kernel * layer.kernel * shapes[layer.inputs[0]].channels;
      std::vector<float>& weights = storage.emplace_back(size_t(layer.out_channels) * fan_in);
      for (float& weight : weights)
        weight = std::sqrt(2.0f / static_cast<float>(fan_in)) * random.normal();
      std::vector<float>& bias = storage.emplace_back(layer.out_channels);
      for (float& value : bias) value = 0.1f * random.normal();
      layer.weights = weights;
      layer.bias = bias;
    }
  }

  std::vector<float> input(uint64_t seed) const {
    Random random(seed);
    std::vector<float> values(size_t(network.input_size) * network.input_size *
                              network.input_channels);
    for (float& value : values) value = random.uniform(-1, 1);
    return values;
  }
};

std::vector<float> run(const RandomNetwork& random, const std::vector<float>& input,
                       uint32_t threads = 1) {
  Result<ThreadPool> pool = ThreadPool::create(threads);
  EXPECT_TRUE(pool.ok());
  Result<std::unique_ptr<NetworkRunner>> runner = NetworkRunner::create(random.network, *pool);
  EXPECT_TRUE(runner.ok()) << runner.status().message();
  if (!runner.ok()) return {};
  std::memcpy((*runner)->input().data(), input.data(), input.size() * sizeof(float));
  EXPECT_TRUE((*runner)->run().ok());
  const std::span<const float> output = std::as_const(**runner).output();
  return {output.begin(), output.end()};
}

double largest_error(const RandomNetwork& random, const char* what) {
  const std::vector<float> input = random.input(2);
  const std::vector<double> truth =
      tests::run_reference<double>(random.network, random.shapes, {input.begin(), input.end()});
  const std::vector<float> output = run(random, input);
  EXPECT_EQ(output.size(), truth.size());
  if (output.size() != truth.size()) return NAN;
  LargestError error(what);
  for (size_t i = 0; i < truth.size(); ++i) error.add(output[i], truth[i]);
  return error.largest();
}

// Sums of up to 576 products of size about 1 in float: 2^-24 * sqrt(576) * a few, over 15 layers.
constexpr double kTolerance = 2e-5;

TEST(NetworkRunner, NanoEqualsTheDefinition) {
  EXPECT_LE(largest_error(RandomNetwork(make_pose_unet(32, 26, 8, head_channels(0))), "nano"),
            kTolerance);
}

TEST(NetworkRunner, EdgeEqualsTheDefinition) {
  EXPECT_LE(largest_error(RandomNetwork(make_pose_unet(128, 26, 32, head_channels(0))), "edge"),
            kTolerance);
}

TEST(NetworkRunner, PaperChannelsEqualTheDefinition) {
  EXPECT_LE(largest_error(RandomNetwork(make_pose_unet(32, 6, 64, head_channels(3))),
                          "paper's channels at T=32"),
            kTolerance);
}

TEST(NetworkRunner, SmallestMapsEqualTheDefinition) {
  // T=8: the lowest resolution is a single pixel.
  EXPECT_LE(largest_error(RandomNetwork(make_pose_unet(8, 6, 3, 14)), "T=8"), kTolerance);
}

TEST(NetworkRunner, UpsamplingEqualsTheDefinitionExactly) {
  // Inputs that are multiples of 1/16 make every product and sum of the weights 1/4 and 3/4 exact.
  RandomNetwork random(
      {.input_size = 4, .input_channels = 3, .layers = {{.op = LayerOp::kUpsample2}}});
  std::vector<float> input = random.input(3);
  for (float& value : input) value = std::round(value * 16) / 16;
  const std::vector<float> truth =
      tests::run_reference<float>(random.network, random.shapes, input);
  EXPECT_EQ(run(random, input), truth);
  EXPECT_EQ(truth[0], input[0]) << "the corner repeats the corner";
}

TEST(NetworkRunner, PoolingAndConcatenationMoveValuesUnchanged) {
  const RandomNetwork random({.input_size = 6,
                              .input_channels = 5,
                              .layers = {{.op = LayerOp::kConcat, .inputs = {0, 0}},
                                         {.op = LayerOp::kMaxPool2, .inputs = {1, 0}}}});
  const std::vector<float> input = random.input(4);
  EXPECT_EQ(run(random, input), tests::run_reference<float>(random.network, random.shapes, input));
}

TEST(NetworkRunner, AnyLayerListIsAllowed) {
  // A residual-like tangle: the input read by three layers, a value read twice, a chain that nobody
  // needs, 1x1 and 3x3 kernels, odd channel counts.
  const auto conv = [](uint32_t input, uint32_t out, uint32_t kernel, bool relu) {
    return Layer{.op = LayerOp::kConv2d,
                 .inputs = {input, 0},
                 .out_channels = out,
                 .kernel = kernel,
                 .relu = relu};
  };
  const RandomNetwork random(
      {.input_size = 12,
       .input_channels = 1,
       .layers = {conv(0, 7, 3, true),                            // 1
                  conv(0, 5, 1, false),                           // 2
                  conv(2, 9, 3, true),                            // 3, needed by 4 alone
                  {.op = LayerOp::kMaxPool2, .inputs = {3, 0}},   // 4, needed by nobody
                  {.op = LayerOp::kConcat, .inputs = {1, 2}},     // 5
                  {.op = LayerOp::kConcat, .inputs = {5, 0}},     // 6
                  {.op = LayerOp::kMaxPool2, .inputs = {6, 0}},   // 7
                  {.op = LayerOp::kUpsample2, .inputs = {7, 0}},  // 8
                  {.op = LayerOp::kConcat, .inputs = {8, 6}},     // 9
                  conv(9, 3, 3, true),
                  conv(10, 2, 1, false)}});
  EXPECT_LE(largest_error(random, "tangle"), kTolerance);
}

TEST(NetworkRunner, ResultsDoNotDependOnThreads) {
  const RandomNetwork random(make_pose_unet(64, 10, 16, 14));
  const std::vector<float> input = random.input(5), one = run(random, input, 1);
  for (uint32_t threads : {2u, 3u, 4u}) {
    const std::vector<float> many = run(random, input, threads);
    ASSERT_EQ(many.size(), one.size());
    EXPECT_EQ(std::memcmp(many.data(), one.data(), one.size() * sizeof(float)), 0)
        << threads << " threads";
  }
}

TEST(NetworkRunner, RunsAgreeAndFollowTheInput) {
  const RandomNetwork random(make_pose_unet(16, 6, 4, 14));
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  Result<std::unique_ptr<NetworkRunner>> runner = NetworkRunner::create(random.network, *pool);
  ASSERT_TRUE(runner.ok());
  const auto evaluate = [&](const std::vector<float>& input) {
    std::memcpy((*runner)->input().data(), input.data(), input.size() * sizeof(float));
    EXPECT_TRUE((*runner)->run().ok());
    const std::span<const float> output = std::as_const(**runner).output();
    return std::vector<float>(output.begin(), output.end());
  };
  const std::vector<float> first = evaluate(random.input(6)), other = evaluate(random.input(7));
  EXPECT_NE(first, other);
  EXPECT_EQ(evaluate(random.input(6)), first);
}

TEST(NetworkRunner, WeightsAreNotReadAfterCreation) {
  auto random = std::make_unique<RandomNetwork>(make_pose_unet(16, 6, 4, 14));
  const std::vector<float> input = random->input(8), truth = run(*random, input);
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  Result<std::unique_ptr<NetworkRunner>> runner = NetworkRunner::create(random->network, *pool);
  ASSERT_TRUE(runner.ok());
  for (std::vector<float>& values : random->storage) std::fill(values.begin(), values.end(), NAN);
  random.reset();
  std::memcpy((*runner)->input().data(), input.data(), input.size() * sizeof(float));
  ASSERT_TRUE((*runner)->run().ok());
  EXPECT_EQ(std::memcmp(std::as_const(**runner).output().data(), truth.data(),
                        truth.size() * sizeof(float)),
            0);
}

TEST(NetworkRunner, RefusesWeightsThatDoNotFit) {
  RandomNetwork random(make_pose_unet(16, 6, 4, 14));
  random.network.layers[0].weights = random.network.layers[0].weights.subspan(1);
  Result<ThreadPool> pool = ThreadPool::create(1);
  ASSERT_TRUE(pool.ok());
  const Result<std::unique_ptr<NetworkRunner>> runner =
      NetworkRunner::create(random.network, *pool);
  ASSERT_FALSE(runner.ok());
  EXPECT_EQ(runner.status().code(), StatusCode::kCorrupt);
}

}  // namespace
}  // namespace figurine::network_runner_test
