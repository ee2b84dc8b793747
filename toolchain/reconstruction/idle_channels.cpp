#include "toolchain/reconstruction/idle_channels.h"

#include <algorithm>

#include "toolchain/tensor_operations.h"

namespace figurine::reconstruction {

IdleChannels::IdleChannels(const model::PoseUNet& unet) : unet_(unet) {
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d || !layer.relu) continue;
    layers_.push_back(i);
    on_.insert(on_.end(), layer.out_channels, false);
  }
}

void IdleChannels::look_at(const torch::Tensor& input) {
  const std::vector<torch::Tensor> values = unet_.evaluate_values(input);
  size_t channel = 0;
  for (const size_t layer : layers_) {
    const torch::Tensor most = values[layer + 1].to(torch::kFloat).amax({0, 2, 3}).contiguous();
    for (int64_t c = 0; c < most.numel(); ++c, ++channel)
      on_[channel] = on_[channel] || most.const_data_ptr<float>()[c] > 0;
  }
}

uint64_t IdleChannels::idle() const {
  return static_cast<uint64_t>(std::count(on_.begin(), on_.end(), false));
}

}  // namespace figurine::reconstruction
