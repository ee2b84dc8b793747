// Fixed point by hand: every rule of its arithmetic on numbers that can be followed on paper, and
// every network that it refuses.
#include "figurine/fixed_point.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "runtime/nn/reference_network.h"

namespace figurine::fixed_point_test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A network in fixed point with the storage behind its spans. Every convolution starts with
// weights, scales and biases of zero, one, zero.
struct Sample {
  Network network;
  FixedPointNetwork fixed;
  std::vector<std::vector<int8_t>> weights;
  std::vector<std::vector<float>> scales;
  std::vector<std::vector<int32_t>> biases;

  explicit Sample(Network bare) : network(std::move(bare)) {
    const std::vector<ValueShape> shapes = *infer_shapes(network, false);
    const size_t count = network.layers.size();
    weights.resize(count);
    scales.resize(count);
    biases.resize(count);
    fixed.values.resize(count);
    fixed.convolutions.resize(count);
    for (size_t i = 0; i < count; ++i) {
      const Layer& layer = network.layers[i];
      if (layer.op != LayerOp::kConv2d) continue;
      weights[i].resize(size_t{layer.out_channels} * layer.kernel * layer.kernel *
                        shapes[layer.inputs[0]].channels);
      scales[i].assign(layer.out_channels, 1);
      biases[i].resize(layer.out_channels);
      fixed.convolutions[i] = {weights[i], scales[i], biases[i]};
    }
  }
  Sample(const Sample&) = delete;

  FixedPointValues evaluate(const std::vector<int16_t>& input) const {
    const Status status = validate_fixed_point(network, fixed);
    EXPECT_TRUE(status.ok()) << status.message();
    return evaluate_fixed_point(network, fixed, input);
  }
};

Layer convolution(uint32_t input, uint32_t out, uint32_t kernel, bool relu = false) {
  return {.op = LayerOp::kConv2d,
          .inputs = {input, 0},
          .out_channels = out,
          .kernel = kernel,
          .relu = relu};
}

// ---- Rounding and clamping

TEST(FixedPoint, RoundsTiesToEven) {
  const std::pair<float, int32_t> cases[] = {
      {0.5f, 0},   {1.5f, 2},        {2.5f, 2},        {-0.5f, 0},    {-1.5f, -2},
      {-2.5f, -2}, {0.49999997f, 0}, {0.50000006f, 1}, {126.5f, 126}, {-127.5f, -128}};
  for (const auto& [x, expected] : cases) EXPECT_EQ(round_to_int(x), expected) << x;
  for (int32_t whole = -4096; whole <= 4096; ++whole) {
    EXPECT_EQ(round_to_int(static_cast<float>(whole) + 0.25f), whole);
    EXPECT_EQ(round_to_int(static_cast<float>(whole) + 0.5f), whole + (whole & 1))
        << "ties to even at " << whole;
  }
}

TEST(FixedPoint, ClampsBeforeItRoundsAndTakesNanForTheLowest) {
  EXPECT_EQ(clamp_and_round(1e30f, -128, 127), 127);
  EXPECT_EQ(clamp_and_round(-1e30f, -128, 127), -128);
  EXPECT_EQ(clamp_and_round(kInfinity, -128, 127), 127);
  EXPECT_EQ(clamp_and_round(-kInfinity, -128, 127), -128);
  EXPECT_EQ(clamp_and_round(kNan, -128, 127), -128);
  EXPECT_EQ(clamp_and_round(126.5f, -128, 127), 126);
  EXPECT_EQ(clamp_and_round(127.5f, -128, 127), 127);
}

TEST(FixedPoint, QuantisesAndDequantises) {
  const Quantisation half{.scale = 0.5f, .zero_point = -3};
  EXPECT_EQ(quantise_int8(0, half), -3) << "zero is exact";
  EXPECT_EQ(quantise_int8(1, half), -1);
  EXPECT_EQ(quantise_int8(0.25f, half), -3)
      << "half a step: the sum 0.5 rounds to even 0, then the zero point";
  EXPECT_EQ(quantise_int8(1000, half), 127);
  EXPECT_EQ(quantise_int8(-1000, half), -128);
  EXPECT_EQ(quantise_int8(kNan, half), -128);
  for (int q = kInt8Min; q <= kInt8Max; ++q) EXPECT_EQ(quantise_int8(dequantise(q, half), half), q);
  EXPECT_EQ(quantise_input(1.0f, 0x1p-12f), 4096);
  EXPECT_EQ(quantise_input(1e30f, 0x1p-12f), 32767);
  EXPECT_EQ(quantise_input(-1e30f, 0x1p-12f), -32767) << "symmetric";
  EXPECT_EQ(quantise_input(kNan, 0x1p-12f), -32767);
}

TEST(FixedPoint, RequantisesWithZeroPointAndRelu) {
  EXPECT_EQ(requantise(10, 0.25f, 5, kInt8Min), 7) << "2.5 rounds to 2";
  EXPECT_EQ(requantise(14, 0.25f, 5, kInt8Min), 9) << "3.5 rounds to 4";
  EXPECT_EQ(requantise(-14, 0.25f, 5, kInt8Min), 1);
  EXPECT_EQ(requantise(-14, 0.25f, 5, 5), 5) << "ReLU stops at the zero point";
  EXPECT_EQ(requantise(INT32_MAX, 255.0f, -128, kInt8Min), 127);
  EXPECT_EQ(requantise(INT32_MIN, 255.0f, 127, kInt8Min), -128);
  EXPECT_EQ(requantise(INT32_MAX, 0x1p-32f, 0, kInt8Min), 0)
      << "float(2^31 - 1) is 2^31: half a step, a tie";
}

TEST(FixedPoint, TheMultiplierHasOneAssociation) {
  // (a w) / o and a (w / o) differ in the last bit here; XNNPACK computes the first.
  const float a = 0.1f, w = 0.3f, o = 0.7f;
  ASSERT_NE(a * w / o, a * (w / o));
  EXPECT_EQ(requantisation_multiplier(a, w, o), (a * w) / o);
}

// ---- Operators

TEST(FixedPoint, ConvolvesByHand) {
  // 2x2 input of one channel, a 3x3 kernel of 1..9, ReLU, then a head of one weight. Outside the
  // image is zero in reals.
  Sample sample({.input_size = 2,
                 .input_channels = 1,
                 .layers = {convolution(0, 1, 3, true), convolution(1, 1, 1)}});
  for (int k = 0; k < 9; ++k) sample.weights[0][size_t(k)] = static_cast<int8_t>(k + 1);
  sample.scales[0] = {0.5f};
  sample.biases[0] = {-20};
  sample.fixed.values = {{.scale = 0.25f}, {.scale = 1, .zero_point = -10}};
  sample.weights[1] = {3};
  sample.scales[1] = {0.125f};
  sample.biases[1] = {7};
  const FixedPointValues out = sample.evaluate({1, 2, 3, 4});
  // Sums: pixel (0,0) sees 1 2 / 3 4 under the kernel's 5 6 / 8 9: 5 + 12 + 24 + 36 - 20 = 57, and
  // so on; times 0.125, plus -10. 57 -> 7.125 -> 7; 47 -> 5.875 -> 6 (4 + 10 + 21 + 32 - 20); 27
  // -> 3.375 -> 3 (2 + 6 + 15 + 24 - 20); 17 -> 2.125 -> 2.
  EXPECT_EQ(out.values[1], (std::vector<int8_t>{-3, -4, -7, -8}));
  // Head: (q + 10) 3 + 7, times 1 x 0.125.
  EXPECT_EQ(out.result, (std::vector<float>{28 * 0.125f, 25 * 0.125f, 16 * 0.125f, 13 * 0.125f}));
}

TEST(FixedPoint, ReluClampsAtTheZeroPoint) {
  Sample sample({.input_size = 1,
                 .input_channels = 1,
                 .layers = {convolution(0, 2, 1, true), convolution(1, 1, 1)}});
  sample.weights[0] = {1, -1};
  sample.fixed.values[1] = {.scale = 1, .zero_point = 20};
  EXPECT_EQ(sample.evaluate({5}).values[1], (std::vector<int8_t>{25, 20}));
  EXPECT_EQ(sample.evaluate({-32767}).values[1], (std::vector<int8_t>{20, 127}));
}

TEST(FixedPoint, TapsOutsideTheImageAreZeroInRealsNotInIntegers) {
  // A constant image at the zero point is zero in reals: the sum is the bias at edges and inside
  // alike.
  Sample sample({.input_size = 3,
                 .input_channels = 1,
                 .layers = {convolution(0, 1, 1), convolution(1, 1, 3), convolution(2, 1, 1)}});
  sample.fixed.values[1] = {.scale = 1, .zero_point = 50};
  std::fill(sample.weights[1].begin(), sample.weights[1].end(), int8_t{100});
  sample.biases[1] = {9};
  const FixedPointValues out = sample.evaluate(std::vector<int16_t>(9, 1234));
  EXPECT_EQ(out.values[1], std::vector<int8_t>(9, 50));
  EXPECT_EQ(out.values[2], std::vector<int8_t>(9, 9));
}

TEST(FixedPoint, PoolTakesTheLargestAndConcatenationKeepsTheOrder) {
  Sample sample({.input_size = 2,
                 .input_channels = 1,
                 .layers = {convolution(0, 2, 1),
                            {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},
                            {.op = LayerOp::kUpsample2, .inputs = {2, 0}},
                            {.op = LayerOp::kConcat, .inputs = {1, 3}},
                            convolution(4, 1, 1)}});
  sample.weights[0] = {1, -1};
  const FixedPointValues out = sample.evaluate({-7, 3, 0, -2});
  EXPECT_EQ(out.values[1], (std::vector<int8_t>{-7, 7, 3, -3, 0, 0, -2, 2}));
  EXPECT_EQ(out.values[2], (std::vector<int8_t>{3, 7}));
  EXPECT_EQ(out.values[4],
            (std::vector<int8_t>{-7, 7, 3, 7, 3, -3, 3, 7, 0, 0, 3, 7, -2, 2, 3, 7}));
}

TEST(FixedPoint, UpsamplingIsTheBilinearDefinitionRounded) {
  // Every place of a 3x3 map, edges included: the definition's value is a multiple of 1/16 and
  // exact in double; halves round up.
  Sample sample({.input_size = 3,
                 .input_channels = 1,
                 .layers = {convolution(0, 1, 1),
                            {.op = LayerOp::kUpsample2, .inputs = {1, 0}},
                            convolution(2, 1, 1)}});
  sample.weights[0] = {1};
  for (int seed = 0; seed < 200; ++seed) {
    std::vector<int16_t> input(9);
    for (size_t i = 0; i < 9; ++i)
      input[i] = static_cast<int16_t>((seed * 7919 + int(i) * int(i + 3) * 613) % 256 - 128);
    if (seed == 0) std::fill(input.begin(), input.end(), int16_t{-128});
    if (seed == 1) std::fill(input.begin(), input.end(), int16_t{127});
    const FixedPointValues out = sample.evaluate(input);
    const std::vector<double> exact =
        tests::upsample<double>({input.begin(), input.end()}, {.size = 3, .channels = 1});
    for (size_t i = 0; i < exact.size(); ++i)
      ASSERT_EQ(out.values[2][i], std::floor(exact[i] + 0.5)) << seed << ", " << i;
  }
}

TEST(FixedPoint, EveryOutputOfTheHeadHasItsOwnScale) {
  Sample sample({.input_size = 1, .input_channels = 2, .layers = {convolution(0, 3, 1)}});
  sample.weights[0] = {100, 0, 0, -127, 1, 1};
  sample.scales[0] = {1, 0x1p-20f, 0.3f};
  sample.biases[0] = {0, 5, -1};
  sample.fixed.values[0] = {.scale = 0.7f};
  const FixedPointValues out = sample.evaluate({32767, -32767});
  EXPECT_EQ(out.result, (std::vector<float>{3276700.0f * 0.7f, 4161414.0f * (0.7f * 0x1p-20f),
                                            -1.0f * (0.7f * 0.3f)}));
}

// ---- What is refused

// A sound network that has every operator; a change is made to it, and the reason has to name the
// place.
void expect_refused(const std::function<void(Sample&)>& bend, const std::string& words) {
  Sample sample({.input_size = 4,
                 .input_channels = 2,
                 .layers = {convolution(0, 3, 3, true),                     // value 1
                            {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},   // 2
                            {.op = LayerOp::kUpsample2, .inputs = {2, 0}},  // 3
                            {.op = LayerOp::kConcat, .inputs = {1, 3}},     // 4
                            convolution(4, 2, 1)}});
  ASSERT_TRUE(validate_fixed_point(sample.network, sample.fixed).ok())
      << validate_fixed_point(sample.network, sample.fixed).message();
  bend(sample);
  const Status status = validate_fixed_point(sample.network, sample.fixed);
  EXPECT_EQ(status.code(), StatusCode::kCorrupt) << words;
  EXPECT_NE(status.message().find(words), std::string::npos)
      << status.message() << " should mention: " << words;
}

TEST(FixedPointValidation, RefusesCountsThatDoNotFit) {
  expect_refused([](Sample& s) { s.fixed.values.pop_back(); }, "not one entry per layer");
  expect_refused([](Sample& s) { s.fixed.convolutions.pop_back(); }, "not one entry per layer");
  expect_refused(
      [](Sample& s) {
        s.fixed.convolutions[0].weights = s.fixed.convolutions[0].weights.subspan(1);
      },
      "layer 0: number of weights");
  expect_refused([](Sample& s) { s.fixed.convolutions[4].weight_scale = {}; },
                 "layer 4: number of weights");
  expect_refused(
      [](Sample& s) { s.fixed.convolutions[4].bias = s.fixed.convolutions[4].bias.first(1); },
      "layer 4: number of weights");
  expect_refused([](Sample& s) { s.network.layers[1].inputs[0] = 9; },
                 "network: layer 1: input is not an earlier value");
}

TEST(FixedPointValidation, RefusesScalesAndZeroPointsThatAreNone) {
  for (const float scale : {0.0f, -1.0f, kNan, kInfinity, FLT_TRUE_MIN, FLT_MIN / 2, 1e6f}) {
    expect_refused([&](Sample& s) { s.fixed.values[3].scale = scale; },
                   "value 3: the scale is not finite and positive");
    expect_refused([&](Sample& s) { s.scales[0][1] = scale; },
                   "layer 0: output 1: the weights' scale is not finite and positive");
    expect_refused([&](Sample& s) { s.scales[4][1] = scale; },
                   "layer 4: output 1: the weights' scale is not finite and positive");
  }
  expect_refused([](Sample& s) { s.fixed.values[1].zero_point = -129; },
                 "value 1: the zero point is out of range");
  expect_refused([](Sample& s) { s.fixed.values[1].zero_point = 128; },
                 "value 1: the zero point is out of range");
  expect_refused([](Sample& s) { s.fixed.values[1].zero_point = INT32_MIN; },
                 "value 1: the zero point is out of range");
  expect_refused([](Sample& s) { s.fixed.values[0].zero_point = 1; },
                 "value 0: the zero point is out of range");
}

TEST(FixedPointValidation, RefusesMultipliersOutsideTheirRange) {
  expect_refused([](Sample& s) { s.scales[0][2] = 256; },
                 "output 2: the multiplier is not within 2^-32 and 256");
  expect_refused([](Sample& s) { s.scales[0][2] = 0x1p-33f; },
                 "output 2: the multiplier is not within 2^-32 and 256");
}

TEST(FixedPointValidation, RefusesSumsWhoseScaleIsNoNormalNumber) {
  // Both factors are sound; their product is denormal, and CPUs may take it for zero.
  for (const size_t layer : {0u, 4u}) {
    expect_refused(
        [&](Sample& s) {
          for (Quantisation& value : s.fixed.values) value.scale = 2 * FLT_MIN;
          s.scales[0].assign(3, 1);
          s.scales[layer][1] = 0.25f;
        },
        "output 1: the scale of the sums is out of range");
  }
}

TEST(FixedPointValidation, RefusesWeightsThatAreNotSymmetric) {
  expect_refused([](Sample& s) { s.weights[0][53] = -128; }, "layer 0: output 2: a weight is -128");
}

TEST(FixedPointValidation, RefusesSumsThatCanOverflow) {
  // 18 weights of 127 on an int16 input: 18 x 127 x 32767 = 74,905,362; the bias may bring it to
  // 2^31 - 1 and no further.
  const auto with_bias = [](int32_t bias) {
    return [bias](Sample& s) {
      std::fill_n(s.weights[0].begin(), 18, int8_t{-127});
      s.biases[0][0] = bias;
    };
  };
  constexpr int32_t kRoom = INT32_MAX - 18 * 127 * 32767;
  expect_refused(with_bias(kRoom + 1), "layer 0: output 0: a sum can overflow int32");
  expect_refused(with_bias(-kRoom - 1), "layer 0: output 0: a sum can overflow int32");
  expect_refused([](Sample& s) { s.biases[0][0] = INT32_MIN; },
                 "layer 0: output 0: a sum can overflow int32");
  Sample sound({.input_size = 4,
                .input_channels = 2,
                .layers = {convolution(0, 1, 3), convolution(1, 1, 1)}});
  with_bias(kRoom)(sound);
  const FixedPointValues out = sound.evaluate(std::vector<int16_t>(32, -32767));
  EXPECT_EQ(out.values[1], std::vector<int8_t>(16, 127));
}

TEST(FixedPointValidation, TheZeroPointCountsInTheBoundOfASum) {
  // Zero point -128 makes steps of up to 255: 6 x 127 x 255 = 194,310.
  const auto with = [](int32_t bias) {
    return [bias](Sample& s) {
      for (size_t value = 1; value < 5; ++value) s.fixed.values[value].zero_point = -128;
      std::fill_n(s.weights[4].begin(), 6, int8_t{127});
      s.biases[4][0] = bias;
    };
  };
  expect_refused(with(INT32_MAX - 6 * 127 * 255 + 1),
                 "layer 4: output 0: a sum can overflow int32");
}

TEST(FixedPointValidation, RefusesQuantisationsThatDiffer) {
  expect_refused([](Sample& s) { s.fixed.values[2].scale = 2; },
                 "layer 1: inputs and output do not share one quantisation");
  expect_refused([](Sample& s) { s.fixed.values[3].zero_point = 1; },
                 "layer 2: inputs and output do not share one quantisation");
  expect_refused([](Sample& s) { s.fixed.values[4].scale = 2; },
                 "layer 3: inputs and output do not share one quantisation");
  expect_refused([](Sample& s) { s.fixed.values[1].scale = 2, s.fixed.values[2].scale = 2; },
                 "layer 2: inputs and output do not share one quantisation");
}

TEST(QuantisationValidation, NeedsNoWeightsAndSaysWhatAWholeNetworkWould) {
  Sample sample({.input_size = 4,
                 .input_channels = 1,
                 .layers = {convolution(0, 2, 3, true),
                            {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},
                            convolution(2, 3, 1)}});
  EXPECT_TRUE(validate_quantisation(sample.network, sample.fixed.values).ok());
  const auto refused = [&](const std::string& words,
                           const std::function<void(Network&, std::vector<Quantisation>&)>& bend) {
    Network network = sample.network;
    FixedPointNetwork fixed = sample.fixed;
    bend(network, fixed.values);
    const Status status = validate_quantisation(network, fixed.values);
    EXPECT_EQ(status.code(), StatusCode::kCorrupt);
    EXPECT_NE(status.message().find(words), std::string::npos) << status.message();
    EXPECT_EQ(validate_fixed_point(network, fixed).message(), status.message());
  };
  refused("not one entry per layer",
          [](Network&, std::vector<Quantisation>& values) { values.pop_back(); });
  refused("value 1: the scale",
          [](Network&, std::vector<Quantisation>& values) { values[1].scale = kNan; });
  refused("value 0: the zero point",
          [](Network&, std::vector<Quantisation>& values) { values[0].zero_point = 1; });
  refused("layer 1: inputs and output do not share",
          [](Network&, std::vector<Quantisation>& values) { values[2].zero_point = 1; });
  refused("layer 1: reads the int16 input",
          [](Network& network, std::vector<Quantisation>&) { network.layers[1].inputs[0] = 0; });
  refused("layer 2: the last layer",
          [](Network& network, std::vector<Quantisation>&) { network.layers[2].relu = true; });
  refused("layer 1: input is not an earlier",
          [](Network& network, std::vector<Quantisation>&) { network.layers[1].inputs[0] = 9; });
}

TEST(FixedPointValidation, RefusesAnInputReadByOthersAndAnEndThatIsNoHead) {
  expect_refused([](Sample& s) { s.network.layers[1].inputs[0] = 0; },
                 "layer 1: reads the int16 input");
  Sample joined({.input_size = 4,
                 .input_channels = 2,
                 .layers = {convolution(0, 2, 1),
                            {.op = LayerOp::kConcat, .inputs = {1, 0}},
                            convolution(2, 1, 1)}});
  EXPECT_NE(validate_fixed_point(joined.network, joined.fixed)
                .message()
                .find("layer 1: reads the int16 input"),
            std::string::npos);
  expect_refused([](Sample& s) { s.network.layers[4].relu = true; },
                 "layer 4: the last layer is not a convolution without ReLU");
  Sample open({.input_size = 4,
               .input_channels = 2,
               .layers = {convolution(0, 2, 1), {.op = LayerOp::kMaxPool2, .inputs = {1, 0}}}});
  EXPECT_NE(
      validate_fixed_point(open.network, open.fixed).message().find("layer 1: the last layer"),
      std::string::npos);
}

}  // namespace
}  // namespace figurine::fixed_point_test
