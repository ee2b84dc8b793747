#include "toolchain/quantize/quantised_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "toolchain/error.h"
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/model/unet.h"
#include "toolchain/quantize/range.h"

namespace figurine::quantize {

namespace {

constexpr float kLargestBias = 0x1p30f;          // steps; leaves half of int32 to the products
constexpr float kSmallestMultiplier = 0x1p-30f;  // XNNPACK's own limit is 2^-32

bool is_head(const Network& network, size_t layer) { return layer + 1 == network.layers.size(); }

struct Output {  // one output of a convolution
  std::span<const float> weights;
  float bias = 0;
};

Output output_of(const Layer& layer, size_t o) {
  const size_t per_output = layer.weights.size() / layer.out_channels;
  return {layer.weights.subspan(o * per_output, per_output), layer.bias[o]};
}

int8_t quantise_weight(float weight, float scale) {
  return static_cast<int8_t>(clamp_and_round(weight / scale, -float(kWeightMax), float(kWeightMax)));
}

// The float expressions of fake quantisation, so that the two agree.
int32_t quantise_bias(float bias, float input_scale, float weight_scale) {
  return static_cast<int32_t>(std::nearbyint(std::clamp(bias / (weight_scale * input_scale), -kLargestBias, kLargestBias)));
}

// Largest magnitude that the output's int32 sum can take.
double largest_sum(const Output& output, float input_scale, float weight_scale, double input_steps) {
  double sum = std::abs(double(quantise_bias(output.bias, input_scale, weight_scale)));
  for (float weight : output.weights) sum += std::abs(int32_t{quantise_weight(weight, weight_scale)}) * input_steps;
  return sum;
}

float choose_scale(const Output& output, const Quantisation& input, bool reads_network_input, float output_scale, WeightRange range) {
  float scale = range == WeightRange::kMaxAbs ? max_abs_scale(output.weights) : smallest_error_scale(output.weights);
  scale = std::max(scale, kSmallestMultiplier * output_scale / input.scale);
  scale = std::max(scale, std::abs(output.bias) / (kLargestBias * input.scale));
  const double steps = reads_network_input ? kInputMax : std::max(kInt8Max - input.zero_point, input.zero_point - kInt8Min);
  while (largest_sum(output, input.scale, scale, steps) > std::numeric_limits<int32_t>::max()) scale *= 2;
  return scale;
}

}  // namespace

std::vector<uint32_t> scale_groups(const Network& network) {
  std::vector<uint32_t> parent(network.layers.size() + 1);
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](uint32_t value) {
    while (parent[value] != value) value = parent[value];
    return value;
  };
  const auto join = [&](uint32_t a, uint32_t b) {
    const auto [first, second] = std::minmax({root(a), root(b)});
    parent[second] = first;
  };
  for (uint32_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op == LayerOp::kConv2d) continue;
    join(layer.inputs[0], i + 1);
    if (layer.op == LayerOp::kConcat) join(layer.inputs[1], i + 1);
  }
  for (uint32_t value = 0; value < parent.size(); ++value) parent[value] = root(value);
  return parent;
}

std::vector<std::vector<float>> choose_weight_scales(const Network& network, const std::vector<Quantisation>& values, WeightRange range) {
  std::vector<std::vector<float>> scales(network.layers.size());
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const float output_scale = is_head(network, i) ? 1.0f : values[i + 1].scale;
    for (size_t o = 0; o < layer.out_channels; ++o) {
      scales[i].push_back(choose_scale(output_of(layer, o), values[layer.inputs[0]], layer.inputs[0] == 0, output_scale, range));
    }
  }
  return scales;
}

QuantisedNetwork::QuantisedNetwork(const Network& network, const Scales& scales)
    : scales_(scales), weights_(network.layers.size()), bias_(network.layers.size()) {
  value_or_throw(infer_shapes(network, true), "fixed point");
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const float input_scale = scales_.values[layer.inputs[0]].scale;
    for (size_t o = 0; o < layer.out_channels; ++o) {
      const Output output = output_of(layer, o);
      const float scale = scales_.weight_scale[i][o];
      for (float weight : output.weights) weights_[i].push_back(quantise_weight(weight, scale));
      bias_[i].push_back(quantise_bias(output.bias, input_scale, scale));
    }
  }
  throw_if_error(validate_fixed_point(network, view()), "quantised network");
}

FixedPointNetwork QuantisedNetwork::view() const {
  FixedPointNetwork network{.convolutions = {}, .values = scales_.values};
  for (size_t i = 0; i < weights_.size(); ++i) network.convolutions.push_back({weights_[i], scales_.weight_scale[i], bias_[i]});
  return network;
}

void imitate(const FixedPointNetwork& fixed, model::PoseUNet& unet) {
  std::vector<float> storage;
  Network network = unet.export_network(storage);
  throw_if_error(validate_fixed_point(network, fixed), "network");
  Scales scales{fixed.values, std::vector<std::vector<float>>(fixed.convolutions.size())};
  std::vector<std::vector<float>> weights(fixed.convolutions.size()), bias = weights;
  for (size_t i = 0; i < fixed.convolutions.size(); ++i) {
    const FixedPointConvolution& convolution = fixed.convolutions[i];
    if (convolution.weights.empty()) continue;
    scales.weight_scale[i].assign(convolution.weight_scale.begin(), convolution.weight_scale.end());
    const size_t per_output = convolution.weights.size() / convolution.bias.size();
    for (size_t k = 0; k < convolution.weights.size(); ++k) {
      weights[i].push_back(static_cast<float>(convolution.weights[k]) * convolution.weight_scale[k / per_output]);
    }
    const float input_scale = fixed.values[network.layers[i].inputs[0]].scale;
    for (size_t o = 0; o < convolution.bias.size(); ++o) {
      bias[i].push_back(static_cast<float>(convolution.bias[o]) * (convolution.weight_scale[o] * input_scale));
    }
    network.layers[i].weights = weights[i];
    network.layers[i].bias = bias[i];
  }
  unet.import_network(network);
  unet.set_fake_quantisation(fake_quantisation(scales));
}

std::shared_ptr<model::FakeQuantisation> fake_quantisation(const Scales& scales) {
  const size_t layers = scales.values.size();
  auto fake = std::make_shared<model::FakeQuantisation>();
  fake->values = scales.values;
  fake->weight_scale.resize(layers);
  for (size_t i = 0; i < layers; ++i) {
    if (!scales.weight_scale[i].empty()) fake->weight_scale[i] = torch::tensor(scales.weight_scale[i]);
  }
  fake->round_weights.assign(layers, true);
  fake->round_value.assign(layers, true);
  return fake;
}

}  // namespace figurine::quantize
