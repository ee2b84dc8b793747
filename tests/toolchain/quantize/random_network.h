// A pose UNet with random weights, its scales from its own values, and an input: what the tests of
// quantisation start from.
#pragma once

#include <random>
#include <vector>

#include "toolchain/model/unet.h"
#include "toolchain/quantize/quantised_network.h"
#include "toolchain/quantize/range.h"

namespace figurine::testing_tools {

inline torch::Tensor random_input(int64_t size, int64_t channels, uint32_t seed) {
  torch::Tensor input = torch::empty({size, size, channels});
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1.5f, 1.5f);
  for (int64_t i = 0; i < input.numel(); ++i) input.data_ptr<float>()[i] = uniform(random);
  return input;
}

// keep: the share of every group's range that is kept; below 1 some values are clipped.
inline quantize::Scales scales_of(const model::PoseUNet& unet, const torch::Tensor& input,
                                  float keep) {
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  const std::vector<uint32_t> group = quantize::scale_groups(network);
  const std::vector<torch::Tensor> values = unet.evaluate_values(input);
  quantize::Scales scales;
  scales.values.resize(network.layers.size());
  scales.values[0] = {values[0].abs().max().item<float>() / float(kInputMax), 0};
  for (size_t root = 1; root < network.layers.size(); ++root) {
    if (group[root] != root) continue;
    quantize::Range range;
    for (size_t value = root; value < network.layers.size(); ++value) {
      if (group[value] == root)
        range.high = std::max(range.high, keep * values[value].max().item<float>());
    }
    for (size_t value = root; value < network.layers.size(); ++value) {
      if (group[value] == root) scales.values[value] = quantize::quantisation_of(range);
    }
  }
  scales.weight_scale =
      quantize::choose_weight_scales(network, scales.values, quantize::WeightRange::kMaxAbs);
  return scales;
}

}  // namespace figurine::testing_tools
