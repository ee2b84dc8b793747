// The plainest way from a float network to fixed point, for tests that need one: ranges from
// smallest to largest of one evaluation. Real packages are calibrated by the trainer.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <vector>

#include "figurine/fixed_point.h"
#include "runtime/nn/reference_network.h"

namespace figurine::tests {

struct QuantisedNetwork {
  FixedPointNetwork fixed;
  std::deque<std::vector<int8_t>> weights;
  std::deque<std::vector<float>> scales;
  std::deque<std::vector<int32_t>> biases;

  QuantisedNetwork(const Network& network, const std::vector<float>& input) {
    const std::vector<ValueShape> shapes = *infer_shapes(network, true);
    choose_quantisations(network, evaluate_reference<float>(network, shapes, input));
    fixed.convolutions.resize(network.layers.size());
    for (size_t i = 0; i < network.layers.size(); ++i) {
      if (network.layers[i].op == LayerOp::kConv2d) quantise_weights(network.layers[i], i);
    }
  }
  QuantisedNetwork(const QuantisedNetwork&) = delete;

 private:
  // Values that pool, upsampling and concatenation tie together share the widest range among them.
  void choose_quantisations(const Network& network, const std::vector<std::vector<float>>& values) {
    std::vector<float> low(values.size()), high(values.size());
    for (size_t value = 0; value < values.size(); ++value) {
      const auto [least, most] = std::ranges::minmax(values[value]);
      low[value] = std::min(least, 0.0f);
      high[value] = std::max(most, 1e-3f);
    }
    for (bool changed = true; changed;) {
      changed = false;
      for (size_t i = 0; i < network.layers.size(); ++i) {
        const Layer& layer = network.layers[i];
        if (layer.op == LayerOp::kConv2d) continue;
        changed |= widen(low, high, layer.inputs[0], i + 1);
        if (layer.op == LayerOp::kConcat) changed |= widen(low, high, layer.inputs[1], i + 1);
      }
    }
    fixed.values.resize(network.layers.size());
    fixed.values[0] = {.scale = std::max(high[0], -low[0]) / static_cast<float>(kInputMax),
                       .zero_point = 0};
    for (size_t value = 1; value < fixed.values.size(); ++value) {
      const float scale = (high[value] - low[value]) / 255;
      fixed.values[value] = {.scale = scale,
                             .zero_point = std::clamp(kInt8Min - round_to_int(low[value] / scale),
                                                      kInt8Min, kInt8Max)};
    }
  }

  static bool widen(std::vector<float>& low, std::vector<float>& high, size_t a, size_t b) {
    const float least = std::min(low[a], low[b]), most = std::max(high[a], high[b]);
    const bool changed = low[a] != least || low[b] != least || high[a] != most || high[b] != most;
    low[a] = low[b] = least;
    high[a] = high[b] = most;
    return changed;
  }

  void quantise_weights(const Layer& layer, size_t i) {
    const size_t per_output = layer.weights.size() / layer.out_channels;
    std::vector<int8_t>& weight = weights.emplace_back();
    std::vector<float>& scale = scales.emplace_back();
    std::vector<int32_t>& bias = biases.emplace_back();
    for (uint32_t o = 0; o < layer.out_channels; ++o) {
      float largest = 1e-6f;
      for (size_t k = 0; k < per_output; ++k)
        largest = std::max(largest, std::fabs(layer.weights[o * per_output + k]));
      scale.push_back(largest / static_cast<float>(kWeightMax));
      for (size_t k = 0; k < per_output; ++k) {
        weight.push_back(
            static_cast<int8_t>(round_to_int(layer.weights[o * per_output + k] / scale[o])));
      }
      bias.push_back(static_cast<int32_t>(std::lround(
          double{layer.bias[o]} / (double{fixed.values[layer.inputs[0]].scale} * scale[o]))));
    }
    fixed.convolutions[i] = {weight, scale, bias};
  }
};

}  // namespace figurine::tests
