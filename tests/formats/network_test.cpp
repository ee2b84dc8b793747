// Shapes, counts and refusals of a network's layer list (formats/src/network.cpp), and the numbers
// that the paper and the presets promise.
#include "figurine/network.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace figurine::network_test {
namespace {

constexpr uint32_t kPaper = 6,
                   kWithFourier =
                       6 +
                       20;  // input channels: maps alone, or with five octaves of Fourier channels

TEST(PoseUnet, ParameterCountsOfThePresets) {
  EXPECT_EQ(count_parameters(make_pose_unet(256, kPaper, 64, head_channels(3))),
            598'011u);  // the paper's "0.6 million"
  EXPECT_EQ(count_parameters(make_pose_unet(128, kPaper, 32, head_channels(0))), 150'094u);
  EXPECT_EQ(count_parameters(make_pose_unet(32, kPaper, 8, head_channels(0))), 9'886u);
  EXPECT_EQ(count_parameters(make_pose_unet(128, kWithFourier, 32, head_channels(0))),
            155'854u);  // edge as shipped
  EXPECT_EQ(count_parameters(make_pose_unet(32, kWithFourier, 8, head_channels(0))),
            11'326u);  // nano as shipped
}

TEST(PoseUnet, FifteenTokensAndTheLargestIsThePapers) {
  const Network network = make_pose_unet(256, kPaper, 64, head_channels(3));
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  std::vector<uint64_t>
      tokens;  // kernel flattened, bias appended: the paper's layer-wise partition
  for (const Layer& layer : network.layers) {
    if (layer.op == LayerOp::kConv2d)
      tokens.push_back(
          (uint64_t(layer.kernel) * layer.kernel * shapes[layer.inputs[0]].channels + 1) *
          layer.out_channels);
  }
  EXPECT_EQ(tokens, (std::vector<uint64_t>{3520, 36928, 36928, 36928, 36928, 36928, 36928, 36928,
                                           73792, 36928, 73792, 36928, 73792, 36928, 3835}));
}

TEST(PoseUnet, MacsAFrame) {
  // By hand, per texel of each level (levels hold 1, 1/4, 1/16, 1/64 of T^2 texels; 9 in out for
  // 3x3):
  //   first level down 9 (in C + C^2); other levels down 18 C^2; up at level l 9 (2 C^2 + C^2) = 27
  //   C^2; head C out.
  const auto by_hand = [](uint64_t size, uint64_t in, uint64_t c, uint64_t out) {
    const uint64_t n = size * size;
    return n * (9 * (in * c + c * c) + 27 * c * c + c * out) + n / 4 * (18 + 27) * c * c +
           n / 16 * (18 + 27) * c * c + n / 64 * 18 * c * c;
  };
  const auto counted = [](const Network& network) {
    return count_macs(network, *infer_shapes(network, false));
  };
  EXPECT_EQ(counted(make_pose_unet(256, kPaper, 64, 59)), by_hand(256, 6, 64, 59));
  EXPECT_EQ(counted(make_pose_unet(128, kPaper, 32, 14)), by_hand(128, 6, 32, 14));
  EXPECT_EQ(counted(make_pose_unet(32, kWithFourier, 8, 14)), by_hand(32, 26, 8, 14));
  EXPECT_NEAR(double(by_hand(256, 6, 64, 59)), 14.0e9, 0.05e9);
  EXPECT_NEAR(double(by_hand(128, 6, 32, 14)), 0.88e9, 0.005e9);
}

TEST(PoseUnet, EndsAtTheInputsResolutionWithTheHeadsChannels) {
  for (uint32_t size : {8u, 32u, 128u, 1024u}) {
    const std::vector<ValueShape> shapes =
        *infer_shapes(make_pose_unet(size, kPaper, 8, head_channels(1)), false);
    EXPECT_EQ(shapes.back().size, size);
    EXPECT_EQ(shapes.back().channels, 23u);
  }
}

TEST(HeadChannels, GrowWithTheSphericalHarmonicsDegree) {
  EXPECT_EQ(head_channels(0), 14u);
  EXPECT_EQ(head_channels(1), 23u);
  EXPECT_EQ(head_channels(2), 38u);
  EXPECT_EQ(head_channels(3), 59u);
}

Layer conv(uint32_t input, uint32_t out, uint32_t kernel) {
  return {.op = LayerOp::kConv2d, .inputs = {input, 0}, .out_channels = out, .kernel = kernel};
}

void expect_corrupt(const Network& network, const std::string& words, bool check_weights = false) {
  const auto shapes = infer_shapes(network, check_weights);
  ASSERT_FALSE(shapes.ok()) << words;
  EXPECT_EQ(shapes.status().code(), StatusCode::kCorrupt);
  EXPECT_NE(shapes.status().message().find(words), std::string::npos) << shapes.status().message();
}

TEST(InferShapes, NamesTheLayerAndTheReason) {
  const auto network = [](std::vector<Layer> layers, uint32_t size = 12) {
    return Network{.input_size = size, .input_channels = 6, .layers = layers};
  };
  expect_corrupt(network({conv(0, 4, 3)}, 0), "input size or channels");
  expect_corrupt(network({conv(0, 4, 3)}, 5000), "input size or channels");
  expect_corrupt({.input_size = 8, .input_channels = 0, .layers = {conv(0, 4, 3)}},
                 "input size or channels");
  expect_corrupt({.input_size = 8, .input_channels = kMaxChannels + 1, .layers = {conv(0, 4, 3)}},
                 "input size or channels");
  expect_corrupt(network({}), "number of layers");
  expect_corrupt(network(std::vector<Layer>(kMaxLayers + 1, conv(0, 4, 1))), "number of layers");
  expect_corrupt(network({conv(1, 4, 3)}),
                 "layer 0: input is not an earlier value");  // its own output
  expect_corrupt(network({conv(0, 4, 3), conv(4'000'000'000u, 4, 3)}),
                 "layer 1: input is not an earlier value");
  expect_corrupt(network({conv(0, 4, 3), {.op = LayerOp::kConcat, .inputs = {0, 2}}}),
                 "layer 1: input is not an earlier value");
  for (uint32_t kernel : {0u, 2u, 5u})
    expect_corrupt(network({conv(0, 4, kernel)}), "layer 0: kernel");
  for (uint32_t out : {0u, kMaxChannels + 1})
    expect_corrupt(network({conv(0, out, 1)}), "layer 0: output channels");
  expect_corrupt(network({{.op = LayerOp::kMaxPool2},
                          {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},
                          {.op = LayerOp::kMaxPool2, .inputs = {2, 0}}}),
                 "layer 2: pools an odd size");  // 12, 6, 3
  expect_corrupt(
      network({{.op = LayerOp::kUpsample2}, {.op = LayerOp::kUpsample2, .inputs = {1, 0}}}, 2048),
      "layer 1: upsamples beyond");
  expect_corrupt(network({{.op = LayerOp::kMaxPool2}, {.op = LayerOp::kConcat, .inputs = {0, 1}}}),
                 "layer 1: concatenates values of different size");
  expect_corrupt(network({conv(0, kMaxChannels, 1), {.op = LayerOp::kConcat, .inputs = {0, 1}}}),
                 "layer 1: output channels");
  expect_corrupt(network({{.op = static_cast<LayerOp>(9)}}), "layer 0: unknown operator");
}

TEST(InferShapes, HoldsWeightsAgainstTheShape) {
  const std::vector<float> weights(4 * 9 * 6), bias(4);
  Layer layer = conv(0, 4, 3);
  layer.weights = weights;
  layer.bias = bias;
  const auto network = [&] {
    return Network{.input_size = 12, .input_channels = 6, .layers = {layer}};
  };
  EXPECT_TRUE(infer_shapes(network(), true).ok());
  layer.weights = std::span(weights).first(weights.size() - 1);
  expect_corrupt(network(), "layer 0: number of weights", true);
  layer.weights = weights;
  layer.bias = std::span(bias).first(3);
  expect_corrupt(network(), "layer 0: number of weights", true);
}

}  // namespace
}  // namespace figurine::network_test
