// Fixed point at the ends of its ranges: everything clipped, nothing there, inputs from far
// outside, the smallest scales, weights of zero. The device's evaluation is held to the definition,
// and the definition to double arithmetic.
#include <algorithm>
#include <cfloat>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <vector>

#include "runtime/src/nn/fixed_point_runner.h"
#include "tests/runtime/nn/fixed_point_networks.h"
#include "tests/runtime/nn/reference_network.h"
#include "tests/stability/rows.h"
#include "tests/stability/scene.h"

namespace figurine::stability {
namespace fixed_point {
namespace {

using tests::RandomFixedPointNetwork;

constexpr uint32_t kSize = 16, kInputs = 6, kChannels = 8;

Network unet() { return make_pose_unet(kSize, kInputs, kChannels, head_channels(0)); }

std::vector<int16_t> quantise(const RandomFixedPointNetwork& random,
                              const std::vector<float>& input) {
  std::vector<int16_t> quantised;
  for (const float value : input)
    quantised.push_back(quantise_input(value, random.fixed.values[0].scale));
  return quantised;
}

// The device's result for every texel.
std::vector<float> run(const RandomFixedPointNetwork& random, const std::vector<float>& input) {
  ThreadPool pool = std::move(ThreadPool::create(1)).value();
  std::vector<uint32_t> texels(size_t{kSize} * kSize);
  std::iota(texels.begin(), texels.end(), 0u);
  const auto runner = FixedPointRunner::create(
      random.network, random.fixed,
      {.varying_channels = kInputs, .constants = {}, .drawn = texels, .wanted = texels}, pool);
  FIG_CHECK(runner.ok(), runner.status().message().c_str());
  for (size_t i = 0; i < input.size(); ++i) {
    (*runner)->input()[i / kInputs * (*runner)->input_stride() + i % kInputs] = input[i];
  }
  FIG_CHECK((*runner)->run().ok(), "the network runs");
  return {(*runner)->output().begin(), (*runner)->output().end()};
}

size_t differ_from_definition(const RandomFixedPointNetwork& random,
                              const std::vector<float>& input) {
  return count_different(
      run(random, input),
      evaluate_fixed_point(random.network, random.fixed, quantise(random, input)).result);
}

void add_agreement(Rows& rows, const std::string& name, const RandomFixedPointNetwork& random,
                   const std::vector<float>& input) {
  rows.push_back({name, "results that differ from the definition", Bound::kAtMost, 0,
                  double(differ_from_definition(random, input))});
}

// Every int8 value against its layer in double, of the same int8 inputs: the largest difference in
// steps. A sum that wrapped would be off by as much as 255.
double largest_step_from_double(const RandomFixedPointNetwork& random,
                                const FixedPointValues& values, const std::vector<int16_t>& input) {
  double largest = 0;
  for (size_t i = 0; i + 1 < random.network.layers.size(); ++i) {
    Layer layer = random.network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const FixedPointConvolution& convolution = random.fixed.convolutions[i];
    const Quantisation &from = random.fixed.values[layer.inputs[0]],
                       &to = random.fixed.values[i + 1];
    std::vector<double> reals;
    if (layer.inputs[0] == 0) {
      for (const int16_t q : input) reals.push_back(double{from.scale} * q);
    } else {
      for (const int8_t q : values.values[layer.inputs[0]])
        reals.push_back(double{from.scale} * (q - from.zero_point));
    }
    const size_t per_output = convolution.weights.size() / layer.out_channels;
    std::vector<float> weights, bias;
    for (size_t k = 0; k < convolution.weights.size(); ++k)
      weights.push_back(convolution.weight_scale[k / per_output] * convolution.weights[k]);
    for (size_t o = 0; o < layer.out_channels; ++o) {
      bias.push_back(static_cast<float>(double{from.scale} * convolution.weight_scale[o] *
                                        convolution.bias[o]));
    }
    layer.weights = weights;
    layer.bias = bias;
    const std::vector<double> outputs =
        tests::convolve<double>(layer, reals, random.shapes[layer.inputs[0]]);
    for (size_t k = 0; k < outputs.size(); ++k) {
      const double exact =
          std::clamp(outputs[k] / to.scale + to.zero_point, double{kInt8Min}, double{kInt8Max});
      largest = std::max(largest, std::abs(values.values[i + 1][k] - exact));
    }
  }
  return largest;
}

// The largest result that weights and a range allow.
double bound_of_result(const RandomFixedPointNetwork& random) {
  const FixedPointConvolution& head = random.fixed.convolutions.back();
  const size_t per_output = head.weights.size() / head.bias.size();
  double bound = 0;
  for (size_t o = 0; o < head.bias.size(); ++o) {
    double sum = std::abs(static_cast<double>(head.bias[o]));
    for (size_t k = 0; k < per_output; ++k)
      sum += 255.0 * std::abs(head.weights[o * per_output + k]);
    bound =
        std::max(bound, sum * random.fixed.values[random.network.layers.back().inputs[0]].scale *
                            head.weight_scale[o]);
  }
  return bound;
}

Rows saturation() {
  Rows rows;
  for (const float gain : {1.0f, 10.0f, 1000.0f}) {
    const RandomFixedPointNetwork random(unet(), 3, gain);
    const std::vector<float> input = random.input(4, kInputs);
    const std::vector<int16_t> quantised = quantise(random, input);
    const FixedPointValues values = evaluate_fixed_point(random.network, random.fixed, quantised);
    const std::string name = "activations " + std::to_string(int(gain)) + " times their range";
    add_agreement(rows, name, random, input);
    rows.push_back({name, "largest step of an int8 value from its layer in double, clipped",
                    Bound::kAtMost, 0.51, largest_step_from_double(random, values, quantised)});
    double largest = 0;
    for (const float value : values.result) largest = std::max(largest, std::abs(double{value}));
    rows.push_back({name, "largest result in shares of what weights and range allow",
                    Bound::kAtMost, 1, largest / bound_of_result(random)});
  }
  return rows;
}

Rows inputs_at_the_ends() {
  Rows rows;
  const RandomFixedPointNetwork random(unet(), 5);
  const size_t count = size_t{kSize} * kSize * kInputs;
  add_agreement(rows, "input of zeros", random, std::vector<float>(count, 0));
  const float end = random.fixed.values[0].scale * kInputMax;
  constexpr float kInfinity = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  const auto differ = [&](float value, float same_as) {
    return double(count_different(run(random, std::vector<float>(count, value)),
                                  run(random, std::vector<float>(count, same_as))));
  };
  const std::string measure = "results that differ from those of the end of the range";
  rows.push_back({"input of 1e30", measure, Bound::kAtMost, 0, differ(1e30f, end)});
  rows.push_back({"input of -1e30", measure, Bound::kAtMost, 0, differ(-1e30f, -end)});
  rows.push_back({"input of infinity", measure, Bound::kAtMost, 0, differ(kInfinity, end)});
  rows.push_back({"input of NaN (no package or pose can make one)",
                  "results that differ from those of the range's low end", Bound::kAtMost, 0,
                  differ(kNan, -end)});
  rows.push_back({"denormal input", "results that differ from those of zeros", Bound::kAtMost, 0,
                  differ(FLT_TRUE_MIN, 0)});
  return rows;
}

Rows smallest_scales() {
  // All scales as small as their products allow: sums of 2^-126, the smallest normal number.
  RandomFixedPointNetwork random(unet(), 6);
  for (Quantisation& value : random.fixed.values) value.scale = 0x1p-110f;
  for (std::vector<float>& scale : random.scales) std::fill(scale.begin(), scale.end(), 0x1p-16f);
  random.fixed.values[0].scale = 0x1p-105f;
  Rows rows;
  const std::vector<float> input = random.input(7, kInputs);
  add_agreement(rows, "scales of 2^-110", random, input);
  size_t denormal = 0;
  for (const float value : run(random, input)) denormal += value != 0 && std::abs(value) < FLT_MIN;
  rows.push_back({"scales of 2^-110", "denormal results", Bound::kAtMost, 0, double(denormal)});
  return rows;
}

Rows weights_of_zero() {
  RandomFixedPointNetwork random(unet(), 8);
  for (std::vector<int8_t>& weights : random.weights)
    std::fill(weights.begin(), weights.end(), int8_t{0});
  const std::vector<float> input = random.input(9, kInputs), result = run(random, input);
  Rows rows;
  add_agreement(rows, "weights of zero", random, input);
  const FixedPointConvolution& head = random.fixed.convolutions.back();
  const float scale = random.fixed.values[random.network.layers.back().inputs[0]].scale;
  size_t different = 0;
  for (size_t i = 0; i < result.size(); ++i) {
    const size_t o = i % head.bias.size();
    different += result[i] != static_cast<float>(head.bias[o]) * (scale * head.weight_scale[o]);
  }
  rows.push_back(
      {"weights of zero", "results that are not their bias", Bound::kAtMost, 0, double(different)});
  return rows;
}

// Poses that no training has seen: every joint turned any way, the maps far beyond the range that
// the network was calibrated on.
Rows far_poses() {
  constexpr int kPoses = 200;
  const tests::SyntheticBody body = tests::make_test_body();
  const tests::SyntheticAvatar avatar =
      tests::make_test_avatar(body, {.held = tests::Held::kFixedPoint});
  const std::unique_ptr<Renderer> renderer = std::move(Renderer::create({})).value();
  const AvatarId id = renderer->add_avatar(*avatar.package, *body.package).value();
  Random random(11);
  size_t not_finite = 0;
  double largest_m = 0;
  for (int i = 0; i < kPoses; ++i) {
    std::vector<float> rotations;
    for (uint32_t j = 0; j < body.body().joint_count(); ++j) {
      const std::array<float, 4> wxyz = random.quaternion();
      rotations.insert(rotations.end(), wxyz.begin(), wxyz.end());
    }
    const GaussianView view = renderer->pose_avatar(id, {{0, 0, 0}, rotations}).value();
    not_finite += count_not_finite(view.position_m) + count_not_finite(view.covariance_factor) +
                  count_not_finite(view.opacity) + count_not_finite(view.sh);
    for (const float value : view.position_m)
      largest_m = std::max(largest_m, std::abs(static_cast<double>(value)));
  }
  const std::string name = std::to_string(kPoses) + " poses of any rotations, calibrated on one";
  return {{name, "values that are not finite", Bound::kAtMost, 0, double(not_finite)},
          {name, "largest coordinate of a figure of 1.6 m", Bound::kAtMost, 2.5, largest_m}};
}

Rows unsound_networks() {
  using Change = std::function<void(RandomFixedPointNetwork&)>;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Change> changes = {
      [](RandomFixedPointNetwork& r) { r.fixed.values[1].scale = 0; },
      [](RandomFixedPointNetwork& r) { r.fixed.values[1].scale = kNan; },
      [](RandomFixedPointNetwork& r) { r.fixed.values[1].scale = FLT_TRUE_MIN; },
      [](RandomFixedPointNetwork& r) { r.fixed.values[1].zero_point = 128; },
      [](RandomFixedPointNetwork& r) { r.fixed.values[0].zero_point = 1; },
      [](RandomFixedPointNetwork& r) { r.fixed.values[2].scale *= 2; },
      [](RandomFixedPointNetwork& r) { r.scales[0][0] = 0; },
      [](RandomFixedPointNetwork& r) { r.scales[0][0] = 1e5f; },
      [](RandomFixedPointNetwork& r) { r.scales[0][0] = FLT_MIN; },
      [](RandomFixedPointNetwork& r) { r.weights[0][0] = -128; },
      [](RandomFixedPointNetwork& r) { r.biases[0][0] = std::numeric_limits<int32_t>::max(); },
      [](RandomFixedPointNetwork& r) { r.biases[0][0] = std::numeric_limits<int32_t>::min(); },
  };
  double accepted = 0;
  for (const Change& change : changes) {
    RandomFixedPointNetwork random(unet(), 1);
    change(random);
    accepted += validate_fixed_point(random.network, random.fixed).ok();
  }
  return {
      {std::to_string(changes.size()) + " networks in fixed point, each with one unsound number",
       "networks accepted", Bound::kAtMost, 0, accepted}};
}

constexpr Case kCases[] = {{"FixedPointSaturation", saturation},
                           {"FixedPointInputs", inputs_at_the_ends},
                           {"FixedPointSmallestScales", smallest_scales},
                           {"FixedPointWeightsOfZero", weights_of_zero},
                           {"FixedPointFarPoses", far_poses},
                           {"FixedPointUnsoundNetworks", unsound_networks}};

}  // namespace
}  // namespace fixed_point

std::span<const Case> fixed_point_cases() { return fixed_point::kCases; }

}  // namespace figurine::stability
