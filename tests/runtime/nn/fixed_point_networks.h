// Random networks in fixed point: full range of int8, another scale for every channel and value,
// values that neither die nor all saturate.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <vector>

#include "figurine/fixed_point.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

struct RandomFixedPointNetwork {
  Network network;
  std::vector<ValueShape> shapes;
  FixedPointNetwork fixed;
  std::deque<std::vector<int8_t>> weights;
  std::deque<std::vector<float>> scales;
  std::deque<std::vector<int32_t>> biases;

  // gain: 1 spreads outputs over int8's range; more saturates them.
  explicit RandomFixedPointNetwork(Network bare, uint64_t seed = 1, float gain = 1)
      : network(std::move(bare)) {
    Random random(seed);
    shapes = *infer_shapes(network, false);
    choose_quantisations(random);
    fixed.convolutions.resize(network.layers.size());
    for (size_t i = 0; i < network.layers.size(); ++i) {
      if (network.layers[i].op == LayerOp::kConv2d) choose_weights(i, gain, random);
    }
  }
  RandomFixedPointNetwork(const RandomFixedPointNetwork&) = delete;

  // Of the input's scale and beyond: a hundredth of the values saturates.
  std::vector<float> input(uint64_t seed, uint32_t channels) const {
    Random random(seed);
    std::vector<float> values(size_t{network.input_size} * network.input_size * channels);
    for (float& value : values)
      value = random.uniform(-1.01f, 1.01f) * fixed.values[0].scale * kInputMax;
    return values;
  }

 private:
  // Pool, upsampling and concatenation tie their inputs and outputs to one quantisation.
  void choose_quantisations(Random& random) {
    const size_t count = network.layers.size();
    std::vector<size_t> tied(count + 1);
    for (size_t value = 0; value <= count; ++value) tied[value] = value;
    const auto root = [&](size_t value) {
      while (tied[value] != value) value = tied[value];
      return value;
    };
    for (size_t i = 0; i < count; ++i) {
      const Layer& layer = network.layers[i];
      if (layer.op == LayerOp::kConv2d) continue;
      tied[root(i + 1)] = root(layer.inputs[0]);
      if (layer.op == LayerOp::kConcat) tied[root(i + 1)] = root(layer.inputs[1]);
    }
    std::vector<Quantisation> chosen(count + 1);
    for (Quantisation& each : chosen) {
      each = {.scale = random.uniform(0.01f, 0.1f),
              .zero_point = static_cast<int32_t>(random.uniform(-128, 128))};
    }
    chosen[0] = {.scale = random.uniform(1e-4f, 1e-3f), .zero_point = 0};
    for (size_t value = 0; value < count; ++value) fixed.values.push_back(chosen[root(value)]);
  }

  void choose_weights(size_t i, float gain, Random& random) {
    const Layer& layer = network.layers[i];
    const uint32_t fan_in = layer.kernel * layer.kernel * shapes[layer.inputs[0]].channels;
    std::vector<int8_t>& weight = weights.emplace_back(size_t{layer.out_channels} * fan_in);
    for (int8_t& each : weight)
      each = static_cast<int8_t>(static_cast<int>(random.uniform(0, 255)) - 127);
    // Standard deviations of uniform weights, and of inputs that fill their range.
    const float input_deviation =
        (layer.inputs[0] == 0 ? static_cast<float>(kInputMax) : 128.0f) * 0.58f;
    const float sum_deviation = 73 * input_deviation * std::sqrt(static_cast<float>(fan_in));
    const bool is_head = i + 1 == network.layers.size();
    std::vector<float>& scale = scales.emplace_back(layer.out_channels);
    std::vector<int32_t>& bias = biases.emplace_back(layer.out_channels);
    for (uint32_t o = 0; o < layer.out_channels; ++o) {
      const float multiplier = gain * random.uniform(0.3f, 2) * 60 / sum_deviation;
      scale[o] = multiplier * (is_head ? 0.01f : fixed.values[i + 1].scale) /
                 fixed.values[layer.inputs[0]].scale;
      bias[o] = static_cast<int32_t>(random.normal() * 0.3f * sum_deviation);
    }
    fixed.convolutions[i] = {weight, scale, bias};
  }
};

}  // namespace figurine::tests
