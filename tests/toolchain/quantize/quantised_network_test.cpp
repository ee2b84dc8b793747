// From a float network to integers: which values share a scale, and the cases that a scale has to
// be raised for.
#include "toolchain/quantize/quantised_network.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/toolchain/quantize/random_network.h"
#include "toolchain/error.h"
#include "toolchain/quantize/range.h"
#include "toolchain/tensor_operations.h"

namespace figurine::quantize::quantised_network_test {
namespace {

// The pose UNet's values: 1, 2 convolutions, 3 pool | 4, 5, 6 | 7, 8, 9 | 10, 11 | up 12, concat 13
// (8, 12), 14, 15 | 16, 17 (5, 16), 18, 19 | 20, 21 (2, 20), 22, 23 | head 24.
TEST(ScaleGroups, JoinSkipsPoolsUpsamplesAndConcatenationsOfThePoseUNet) {
  const std::vector<uint32_t> group = scale_groups(make_pose_unet(32, 6, 8, 14));
  ASSERT_EQ(group.size(), 25u);
  const std::vector<uint32_t> expected{0, 1,  2, 2, 4, 5,  5, 7, 8, 8,  10, 8, 8,
                                       8, 14, 5, 5, 5, 18, 2, 2, 2, 22, 23, 24};
  EXPECT_EQ(group, expected);
}

// One 1x1 convolution with ReLU, two outputs, before a head that reads both.
class TwoOutputs : public ::testing::Test {
 protected:
  TwoOutputs() {
    network.layers = {
        {.op = LayerOp::kConv2d, .inputs = {0, 0}, .out_channels = 2, .kernel = 1, .relu = true},
        {.op = LayerOp::kConv2d, .inputs = {1, 0}, .out_channels = 1, .kernel = 1}};
    network.layers[0].weights = weights;
    network.layers[0].bias = bias;
    network.layers[1].weights = head_weights;
    network.layers[1].bias = head_bias;
  }
  Scales scales() const {
    return {values, choose_weight_scales(network, values, WeightRange::kMaxAbs)};
  }

  std::vector<float> weights{0.5f, -1.27f}, bias{0.1f, 0.2f}, head_weights{0.254f, 0.1f},
      head_bias{-1};
  std::vector<Quantisation> values{{0.001f, 0}, {0.02f, -128}};
  Network network{.input_size = 2, .input_channels = 1};
};

TEST_F(TwoOutputs, WeightsAndBiasesAreRoundedInTheirOwnOutputsUnits) {
  const QuantisedNetwork quantised(network, scales());
  const FixedPointNetwork fixed = quantised.view();
  EXPECT_EQ(fixed.convolutions[0].weights[0], 127);
  EXPECT_EQ(fixed.convolutions[0].weights[1], -127);
  EXPECT_FLOAT_EQ(fixed.convolutions[0].weight_scale[1], 0.01f);
  EXPECT_EQ(fixed.convolutions[0].bias[1], 20000);  // 0.2 / (0.001 x 0.01)
  EXPECT_EQ(fixed.convolutions[1].weights[0], 127);
  EXPECT_EQ(fixed.convolutions[1].weights[1], 50);   // 0.1 / 0.002
  EXPECT_EQ(fixed.convolutions[1].bias[0], -25000);  // -1 / (0.02 x 0.002)
}

TEST_F(TwoOutputs, ADeadOutputIsSoundAndItsBiasIsKept) {
  weights[0] = 0;
  head_weights = {0, 0};
  network.layers[1].weights = head_weights;
  const QuantisedNetwork quantised(network, scales());
  const FixedPointNetwork fixed = quantised.view();
  EXPECT_EQ(fixed.convolutions[0].weights[0], 0);
  EXPECT_NEAR(double(fixed.convolutions[0].bias[0]) * 0.001 * fixed.convolutions[0].weight_scale[0],
              0.1, 1e-7);
  const std::vector<int16_t> input(4, 1000);
  EXPECT_NEAR(evaluate_fixed_point(network, fixed, input).result[0], -1, 1e-6);
}

TEST_F(TwoOutputs, ABiasTooLargeForItsWeightsRaisesTheScale) {
  weights = {1e-9f, 1e-9f};
  bias = {3, -3};
  network.layers[0].weights = weights;
  network.layers[0].bias = bias;
  values[1] = quantisation_of({0, 3});
  const QuantisedNetwork quantised(network, scales());
  const std::vector<int16_t> input(4, 32767);
  const FixedPointValues result = evaluate_fixed_point(network, quantised.view(), input);
  EXPECT_EQ(result.values[1][0], 127);   // 3, the range's end
  EXPECT_EQ(result.values[1][1], -128);  // ReLU of -3
}

TEST_F(TwoOutputs, ScalesOfAnotherShapeAreRefused) {
  Scales bad = scales();
  bad.weight_scale[0][1] = 0;
  EXPECT_THROW(QuantisedNetwork(network, bad), InputError);
}

TEST(QuantisedNetwork, OfARandomUNetIsSoundWithBothWeightRanges) {
  model::PoseUNet unet(make_pose_unet(32, 6, 8, 14),
                       {.precision = model::Precision::kFloat32, .seed = 9});
  const torch::Tensor input = testing_tools::random_input(32, 6, 10);
  Scales scales = testing_tools::scales_of(unet, input, 1);
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  for (WeightRange range : {WeightRange::kMaxAbs, WeightRange::kSmallestError}) {
    scales.weight_scale = choose_weight_scales(network, scales.values, range);
    EXPECT_NO_THROW(QuantisedNetwork(network, scales));
  }
}

}  // namespace
}  // namespace figurine::quantize::quantised_network_test
