#include "figurine/network.h"

#include <algorithm>
#include <string>

namespace figurine {

namespace {

Status corrupt(size_t layer, const char* what) {
  return Status(StatusCode::kCorrupt, "network: layer " + std::to_string(layer) + ": " + what);
}

uint64_t weight_count(const Layer& layer, const ValueShape& input) {
  return uint64_t(layer.out_channels) * layer.kernel * layer.kernel * input.channels;
}

}  // namespace

Result<std::vector<ValueShape>> infer_shapes(const Network& network, bool check_weights) {
  if (network.input_size < 1 || network.input_size > 4096 || network.input_channels < 1 ||
      network.input_channels > kMaxChannels) {
    return Status(StatusCode::kCorrupt, "network: input size or channels out of range");
  }
  if (network.layers.empty() || network.layers.size() > kMaxLayers)
    return Status(StatusCode::kCorrupt, "network: number of layers out of range");
  std::vector<ValueShape> shapes{{network.input_size, network.input_channels}};
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.inputs[0] > i || (layer.op == LayerOp::kConcat && layer.inputs[1] > i))
      return corrupt(i, "input is not an earlier value");
    const ValueShape a = shapes[layer.inputs[0]];
    switch (layer.op) {
      case LayerOp::kConv2d:
        if (layer.kernel != 1 && layer.kernel != 3) return corrupt(i, "kernel is neither 1 nor 3");
        if (layer.out_channels < 1 || layer.out_channels > kMaxChannels)
          return corrupt(i, "output channels out of range");
        if (check_weights && (layer.weights.size() != weight_count(layer, a) ||
                              layer.bias.size() != layer.out_channels)) {
          return corrupt(i, "number of weights does not fit the shape");
        }
        shapes.push_back({a.size, layer.out_channels});
        break;
      case LayerOp::kMaxPool2:
        if (a.size % 2 != 0) return corrupt(i, "pools an odd size");
        shapes.push_back({a.size / 2, a.channels});
        break;
      case LayerOp::kUpsample2:
        if (a.size > 2048) return corrupt(i, "upsamples beyond 4096");
        shapes.push_back({a.size * 2, a.channels});
        break;
      case LayerOp::kConcat: {
        const ValueShape b = shapes[layer.inputs[1]];
        if (a.size != b.size) return corrupt(i, "concatenates values of different size");
        if (a.channels + b.channels > kMaxChannels)
          return corrupt(i, "output channels out of range");
        shapes.push_back({a.size, a.channels + b.channels});
        break;
      }
      default:
        return corrupt(i, "unknown operator");
    }
  }
  return shapes;
}

uint64_t count_macs(const Network& network, const std::vector<ValueShape>& shapes) {
  uint64_t macs = 0;
  for (const Layer& layer : network.layers) {
    if (layer.op != LayerOp::kConv2d) continue;
    const ValueShape& input = shapes[layer.inputs[0]];
    macs += weight_count(layer, input) * input.size * input.size;
  }
  return macs;
}

uint64_t count_parameters(const Network& network) {
  const Result<std::vector<ValueShape>> shapes = infer_shapes(network, false);
  if (!shapes.ok()) return 0;
  uint64_t parameters = 0;
  for (const Layer& layer : network.layers) {
    if (layer.op == LayerOp::kConv2d)
      parameters += weight_count(layer, (*shapes)[layer.inputs[0]]) + layer.out_channels;
  }
  return parameters;
}

bool has_weights(const Network& network) {
  return std::any_of(network.layers.begin(), network.layers.end(),
                     [](const Layer& layer) { return !layer.weights.empty(); });
}

Network make_pose_unet(uint32_t uv_size, uint32_t input_channels, uint32_t channels,
                       uint32_t output_channels) {
  Network network{.input_size = uv_size, .input_channels = input_channels, .layers = {}};
  const auto add = [&](const Layer& layer) {
    network.layers.push_back(layer);
    return static_cast<uint32_t>(network.layers.size());  // index of the layer's output value
  };
  const auto conv = [&](uint32_t input, uint32_t out, uint32_t kernel, bool relu) {
    return add({.op = LayerOp::kConv2d,
                .inputs = {input, 0},
                .out_channels = out,
                .kernel = kernel,
                .relu = relu});
  };
  constexpr int kLevels = 4;
  uint32_t skips[kLevels] = {};
  uint32_t value = 0;
  for (int level = 0; level < kLevels; ++level) {
    if (level > 0) value = add({.op = LayerOp::kMaxPool2, .inputs = {value, 0}});
    value = conv(value, channels, 3, true);
    value = conv(value, channels, 3, true);
    skips[level] = value;
  }
  for (int level = kLevels - 2; level >= 0; --level) {
    const uint32_t up = add({.op = LayerOp::kUpsample2, .inputs = {value, 0}});
    value = add({.op = LayerOp::kConcat, .inputs = {skips[level], up}});
    value = conv(value, channels, 3, true);
    value = conv(value, channels, 3, true);
  }
  conv(value, output_channels, 1, false);
  return network;
}

}  // namespace figurine
