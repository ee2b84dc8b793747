#include <torch/torch.h>

#include <vector>

#include "bench/peers/network_peer.h"

namespace figurine::peers {
namespace {

class TorchPeer final : public NetworkPeer {
 public:
  TorchPeer(const Network& network, const ValueShape& input, const ValueShape& output)
      : network_(network), in_(input), out_(output) {
    const torch::InferenceMode inference;
    at::set_num_threads(1);
    std::vector<int64_t> channels = {input.channels};
    for (const Layer& layer : network.layers) {
      Weights weights;
      channels.push_back(layer.op == LayerOp::kConv2d ? layer.out_channels
                         : layer.op == LayerOp::kConcat
                             ? channels[layer.inputs[0]] + channels[layer.inputs[1]]
                             : channels[layer.inputs[0]]);
      if (layer.op == LayerOp::kConv2d) {
        const int64_t k = layer.kernel;
        weights.kernel = torch::from_blob(const_cast<float*>(layer.weights.data()),
                                          {layer.out_channels, k, k, channels[layer.inputs[0]]})
                             .permute({0, 3, 1, 2})
                             .clone()
                             .contiguous(at::MemoryFormat::ChannelsLast);
        weights.bias = torch::from_blob(const_cast<float*>(layer.bias.data()),
                                        {static_cast<int64_t>(layer.out_channels)})
                           .clone();
      }
      weights_.push_back(std::move(weights));
    }
  }

  void set_input(std::span<const float> input) override {
    const torch::InferenceMode inference;
    input_ =
        torch::from_blob(const_cast<float*>(input.data()), {1, in_.size, in_.size, in_.channels})
            .permute({0, 3, 1, 2})
            .clone(at::MemoryFormat::ChannelsLast);
  }
  void run() override {
    const torch::InferenceMode inference;
    std::vector<at::Tensor> values = {input_};
    for (size_t i = 0; i < network_.layers.size(); ++i) {
      const Layer& layer = network_.layers[i];
      const at::Tensor& first = values[layer.inputs[0]];
      switch (layer.op) {
        case LayerOp::kConv2d: {
          at::Tensor value = at::conv2d(first, weights_[i].kernel, weights_[i].bias, 1,
                                        static_cast<int64_t>(layer.kernel / 2));
          values.push_back(layer.relu ? value.relu_() : value);
          break;
        }
        case LayerOp::kMaxPool2:
          values.push_back(at::max_pool2d(first, 2, 2));
          break;
        case LayerOp::kUpsample2:
          values.push_back(at::upsample_bilinear2d(
              first, at::IntArrayRef({2 * first.size(2), 2 * first.size(3)}), false));
          break;
        case LayerOp::kConcat:
          values.push_back(at::cat({first, values[layer.inputs[1]]}, 1));
          break;
      }
    }
    output_ = values.back();
  }
  void get_output(std::span<float> output) override {
    const torch::InferenceMode inference;
    const at::Tensor rows = output_.permute({0, 2, 3, 1}).contiguous();
    std::copy_n(rows.data_ptr<float>(), output.size(), output.begin());
  }

 private:
  struct Weights {
    at::Tensor kernel, bias;
  };
  Network network_;
  ValueShape in_, out_;
  std::vector<Weights> weights_;
  at::Tensor input_, output_;
};

}  // namespace

std::unique_ptr<NetworkPeer> make_torch_peer(const Network& network, const ValueShape& input,
                                             const ValueShape& output) {
  return std::make_unique<TorchPeer>(network, input, output);
}

std::string torch_name() { return "LibTorch " TORCH_VERSION; }

}  // namespace figurine::peers
