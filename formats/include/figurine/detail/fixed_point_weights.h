// A float network to integers: what the packer does with a trained avatar and the device with a
// sampled one, in one arithmetic (docs/numerics.md, "Fixed point"). The same bits on every CPU.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/fixed_point.h"
#include "figurine/network.h"
#include "figurine/status.h"

namespace figurine {

// One output of a convolution, and what its weights' scale has to go with.
struct OutputWeights {
  std::span<const float> weights;
  float bias = 0;
  Quantisation input;
  bool reads_network_input = false;  // int16
  float output_scale = 1;            // 1 for the head, whose result is float
};

// The scale that puts the largest weight at 127; 0 for weights of zero.
float max_abs_scale(std::span<const float> weights);

// The scale, raised where fixed point needs it: weights of zero, a bias that is large against the
// weights, a multiplier below XNNPACK's smallest, a sum that could overflow.
float raise_weight_scale(float scale, const OutputWeights& output);

// Calls use(layer, output, OutputWeights) for every output of every convolution. values: [layers];
// network: with weights.
template <class Use>
void for_each_output(const Network& network, std::span<const Quantisation> values, const Use& use) {
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const size_t size = layer.weights.size() / layer.out_channels;
    const bool is_head = i + 1 == network.layers.size();
    for (size_t o = 0; o < layer.out_channels; ++o) {
      use(i, o,
          OutputWeights{.weights = layer.weights.subspan(o * size, size),
                        .bias = layer.bias[o],
                        .input = values[layer.inputs[0]],
                        .reads_network_input = layer.inputs[0] == 0,
                        .output_scale = is_head ? 1.0f : values[i + 1].scale});
    }
  }
}

// Owns what a FixedPointNetwork borrows.
class FixedPointStorage {
 public:
  // Scales of max_abs_scale, raised where needed. values: [layers]. kCorrupt "fixed point: ..." if
  // the result is not sound (validate_fixed_point), e.g. for weights that are not finite;
  // kInvalidArgument if the network has no weights.
  Status quantise(const Network& network, std::span<const Quantisation> values);
  // With given scales: [layers][out], empty for layers without weights.
  Status quantise(const Network& network, std::span<const Quantisation> values,
                  std::vector<std::vector<float>> weight_scale);

  FixedPointNetwork view() const;  // borrows from this object

 private:
  std::vector<Quantisation> values_;
  std::vector<std::vector<float>> weight_scale_;
  std::vector<std::vector<int8_t>> weights_;
  std::vector<std::vector<int32_t>> bias_;
};

}  // namespace figurine
