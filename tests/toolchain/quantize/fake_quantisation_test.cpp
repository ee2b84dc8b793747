// The trainer's imitation of fixed point against the integers themselves, and its gradients by
// hand.
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/tensor_operations.h"

#include <gtest/gtest.h>

#include "tests/largest_error.h"
#include "tests/toolchain/quantize/random_network.h"

namespace figurine::model::fake_quantisation_test {
namespace {

using testing_tools::random_input;
using testing_tools::scales_of;

PoseUNet random_unet(uint32_t size, uint32_t input_channels, uint32_t channels) {
  return PoseUNet(make_pose_unet(size, input_channels, channels, head_channels(0)),
                  {.precision = Precision::kFloat32, .seed = 3, .head_weight_factor = 1});
}

std::vector<int16_t> quantise(const torch::Tensor& input, float scale) {
  std::vector<int16_t> steps;
  for (int64_t i = 0; i < input.numel(); ++i)
    steps.push_back(quantise_input(input.const_data_ptr<float>()[i], scale));
  return steps;
}

// All sums but the first layer's are exact, so a value can only differ where a rounded sum of the
// first layer falls on the other side of a half: one step there, and at most one after it where the
// layers average.
TEST(FakeQuantisation, EqualsTheIntegersToOneStep) {
  for (const float keep : {1.0f, 0.6f}) {
    PoseUNet unet = random_unet(32, 26, 8);
    const torch::Tensor input = random_input(32, 26, 4);
    const quantize::Scales scales = scales_of(unet, input, keep);
    std::vector<float> storage;
    const Network network = unet.export_network(storage);
    const quantize::QuantisedNetwork quantised(network, scales);
    const FixedPointValues integers =
        evaluate_fixed_point(network, quantised.view(), quantise(input, scales.values[0].scale));
    unet.set_fake_quantisation(quantize::fake_quantisation(scales));
    const std::vector<torch::Tensor> fake = unet.evaluate_values(input);
    LargestError steps("fake quantisation against the integers, steps");
    size_t differing = 0, clipped = 0;
    for (size_t value = 1; value + 1 < fake.size(); ++value) {
      const torch::Tensor rows = fake[value].permute({0, 2, 3, 1}).contiguous();
      ASSERT_EQ(size_t(rows.numel()), integers.values[value].size());
      for (size_t i = 0; i < integers.values[value].size(); ++i) {
        const float step = rows.const_data_ptr<float>()[i],
                    truth = float(integers.values[value][i] - scales.values[value].zero_point);
        steps.add(step, truth);
        differing += step != truth;
        clipped += integers.values[value][i] == kInt8Max;
      }
    }
    std::printf("range kept %.1f: %zu values differ, %zu at the upper limit\n", keep, differing,
                clipped);
    EXPECT_LE(steps.largest(), 1);
    EXPECT_LE(differing, 20u);
    EXPECT_TRUE(keep == 1 || clipped > 100) << "the test should see clipping";
    LargestError result("fake-quantised result against the integers'");
    const torch::Tensor head = fake.back().permute({0, 2, 3, 1}).contiguous();
    for (size_t i = 0; i < integers.result.size(); ++i)
      result.add(head.const_data_ptr<float>()[i], integers.result[i]);
    EXPECT_LT(result.largest(), 0.05);  // a few int8 steps of the head's input times its weights
  }
}

TEST(FakeQuantisation, WithoutRoundingIsTheFloatNetworkWithItsGradients) {
  PoseUNet unet = random_unet(32, 6, 8);
  const torch::Tensor input = random_input(32, 6, 5), seed = random_input(32, 14, 6);
  const torch::Tensor plain = unet.forward(input);
  plain.backward(seed);
  const torch::Tensor plain_gradient = unet.gradients().clone();
  unet.zero_gradients();
  const auto fake = quantize::fake_quantisation(scales_of(unet, input, 1));
  fake->round_weights.assign(fake->round_weights.size(), false);
  fake->round_value.assign(fake->round_value.size(), false);
  unet.set_fake_quantisation(fake);
  const torch::Tensor same = unet.forward(input);
  same.backward(seed);
  const double head_error =
      (same - plain).abs().max().item<double>() / plain.abs().max().item<double>();
  const double gradient_error = (unet.gradients() - plain_gradient).abs().max().item<double>() /
                                plain_gradient.abs().max().item<double>();
  std::printf("largest error: head %.3g, gradient %.3g of the largest\n", head_error,
              gradient_error);
  EXPECT_LT(head_error, 1e-5);
  EXPECT_LT(gradient_error, 1e-4);  // a ReLU or a pool near a tie may choose differently
}

TEST(FakeQuantisation, LeavesThePlainPathAsItWasToTheBit) {
  PoseUNet unet = random_unet(32, 6, 8);
  const torch::Tensor input = random_input(32, 6, 7);
  const torch::Tensor before = unet.forward(input).detach().clone(),
                      weights = unet.weights().detach().clone();
  unet.set_fake_quantisation(quantize::fake_quantisation(scales_of(unet, input, 0.9f)));
  EXPECT_FALSE(torch::equal(unet.forward(input), before));
  unet.set_fake_quantisation(nullptr);
  EXPECT_TRUE(torch::equal(unet.forward(input), before));
  EXPECT_TRUE(torch::equal(unet.weights(), weights));
}

// Two 1x1 convolutions of one channel over 2x2 pixels: y = head(relu(w x + b)).
struct TwoLayers {
  Network network{.input_size = 2, .input_channels = 1};
  TwoLayers() {
    network.layers = {
        {.op = LayerOp::kConv2d, .inputs = {0, 0}, .out_channels = 1, .kernel = 1, .relu = true},
        {.op = LayerOp::kConv2d, .inputs = {1, 0}, .out_channels = 1, .kernel = 1}};
  }
};

TEST(FakeQuantisation, GradientsAreStraightThroughAndZeroWhereClipped) {
  PoseUNet unet(TwoLayers().network, {.precision = Precision::kFloat32});
  {
    torch::NoGradGuard no_gradient;
    unet.weights().copy_(torch::tensor({0.5f, 0.0f, 2.0f, 0.0f}));  // w, b, head's w, head's b
  }
  // Steps: input 1/4, w 1/100, value 1/10 (0 to 25.5), head's w 1/50. The last input lies beyond
  // the value's range.
  const quantize::Scales scales{{{0.25f, 0}, {0.1f, -128}}, {{0.01f}, {0.02f}}};
  unet.set_fake_quantisation(quantize::fake_quantisation(scales));
  const torch::Tensor input = torch::tensor({1.1f, -2.0f, 3.0f, 80.0f}).view({2, 2, 1});
  const torch::Tensor head = unet.forward(input);
  // 1.1 -> 1.0; 0.5 x 1.0 = 0.5; 3.0 -> 1.5; 40 -> 25.5; the head's 2.0 is 100 steps of 0.02.
  const float expected[] = {1.0f, 0.0f, 3.0f, 51.0f};
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(head.flatten()[i].item<float>(), expected[i], 1e-5) << i;
  head.backward(torch::ones({2, 2, 1}));
  // dw = 2 x (rounded inputs where 0 < w x < 25.5) = 2 x (1 + 3); db = 2 x 2 pixels; head: sum of
  // its inputs 0.5 + 1.5 + 25.5, 4 pixels.
  const float gradients[] = {8.0f, 4.0f, 27.5f, 4.0f};
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(unet.gradients()[i].item<float>(), gradients[i], 1e-4) << i;
}

TEST(FakeQuantisation, ClippedWeightsGetNoGradient) {
  PoseUNet unet(TwoLayers().network, {.precision = Precision::kFloat32});
  {
    torch::NoGradGuard no_gradient;
    unet.weights().copy_(torch::tensor({1.5f, 0.0f, 2.0f, 0.0f}));
  }
  const quantize::Scales scales{{{0.25f, 0}, {0.1f, -128}},
                                {{0.01f}, {0.02f}}};  // w is clipped at 1.27
  unet.set_fake_quantisation(quantize::fake_quantisation(scales));
  const torch::Tensor head = unet.forward(torch::ones({2, 2, 1}));
  EXPECT_NEAR(head.flatten()[0].item<float>(), 2.6f, 1e-5);  // 1.27 rounds to 13 steps of 0.1
  head.backward(torch::ones({2, 2, 1}));
  EXPECT_EQ(unet.gradients()[0].item<float>(), 0);
  EXPECT_NEAR(unet.gradients()[2].item<float>(), 4 * 1.3f, 1e-5);
}

TEST(FakeQuantisation, DynamicRangesFollowTheInput) {
  PoseUNet unet = random_unet(32, 6, 8);
  const torch::Tensor input = random_input(32, 6, 8), plain = unet.forward(input).detach();
  const auto fake = quantize::fake_quantisation(
      scales_of(unet, input, 0.01f));  // static ranges that would ruin everything
  const auto error = [&](bool dynamic) {
    fake->dynamic_ranges = dynamic;
    unet.set_fake_quantisation(fake);
    torch::NoGradGuard no_gradient;
    return ((unet.forward(input) - plain).norm() / plain.norm()).item<double>();
  };
  const double fixed = error(false), dynamic = error(true);
  std::printf("relative error: static %.3g, dynamic %.3g\n", fixed, dynamic);
  EXPECT_GT(fixed, 0.2);
  EXPECT_LT(dynamic, 0.05);
}

}  // namespace
}  // namespace figurine::model::fake_quantisation_test
