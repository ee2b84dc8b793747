#include "toolchain/quantize/quantised_network.h"

#include <algorithm>
#include <numeric>

#include "toolchain/error.h"
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/model/unet.h"
#include "toolchain/quantize/range.h"
#include "toolchain/tensor_operations.h"

namespace figurine::quantize {

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

std::vector<std::vector<float>> choose_weight_scales(const Network& network,
                                                     const std::vector<Quantisation>& values,
                                                     WeightRange range) {
  std::vector<std::vector<float>> scales(network.layers.size());
  for_each_output(network, values, [&](size_t layer, size_t, const OutputWeights& output) {
    const float scale = range == WeightRange::kMaxAbs ? max_abs_scale(output.weights)
                                                      : smallest_error_scale(output.weights);
    scales[layer].push_back(raise_weight_scale(scale, output));
  });
  return scales;
}

QuantisedNetwork::QuantisedNetwork(const Network& network, const Scales& scales)
    : values_(scales.values) {
  throw_if_error(storage_.quantise(network, scales.values, scales.weight_scale),
                 "quantised network");
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
      weights[i].push_back(static_cast<float>(convolution.weights[k]) *
                           convolution.weight_scale[k / per_output]);
    }
    const float input_scale = fixed.values[network.layers[i].inputs[0]].scale;
    for (size_t o = 0; o < convolution.bias.size(); ++o) {
      bias[i].push_back(static_cast<float>(convolution.bias[o]) *
                        (convolution.weight_scale[o] * input_scale));
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
    if (!scales.weight_scale[i].empty())
      fake->weight_scale[i] = torch::tensor(scales.weight_scale[i]);
  }
  fake->round_weights.assign(layers, true);
  fake->round_value.assign(layers, true);
  return fake;
}

}  // namespace figurine::quantize
