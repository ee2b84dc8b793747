#include "bench/dynamic_network.h"

#include <xnnpack.h>

#include <deque>
#include <limits>
#include <vector>

#include "figurine/check.h"

namespace figurine::bench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

void check(xnn_status status) { FIG_CHECK(status == xnn_status_success, "XNNPACK refuses"); }

class Builder {
 public:
  Builder(const Network& network, const FixedPointNetwork& fixed)
      : network_(network),
        fixed_(fixed),
        shapes_(*infer_shapes(network, false)),
        ids_(shapes_.size()) {
    check(xnn_initialize(nullptr));
    check(xnn_create_subgraph(2, 0, &subgraph_));
    for (size_t value = 0; value < shapes_.size(); ++value) define_value(value);
    for (size_t i = 0; i < network.layers.size(); ++i) define_layer(i);
  }
  ~Builder() { xnn_delete_subgraph(subgraph_); }

  xnn_subgraph_t subgraph() const { return subgraph_; }
  const std::vector<ValueShape>& shapes() const { return shapes_; }

 private:
  void define_value(size_t value) {
    const size_t dims[4] = {1, shapes_[value].size, shapes_[value].size, shapes_[value].channels};
    const bool is_input = value == 0, is_output = value + 1 == shapes_.size();
    check(xnn_define_tensor_value(subgraph_, xnn_datatype_fp32, 4, dims, nullptr,
                                  is_input    ? 0
                                  : is_output ? 1
                                              : XNN_INVALID_VALUE_ID,
                                  is_input    ? XNN_VALUE_FLAG_EXTERNAL_INPUT
                                  : is_output ? XNN_VALUE_FLAG_EXTERNAL_OUTPUT
                                              : 0,
                                  &ids_[value]));
  }

  void define_convolution(size_t i) {
    const Layer& layer = network_.layers[i];
    const ValueShape& in = shapes_[layer.inputs[0]];
    const size_t dims[4] = {1, in.size, in.size, in.channels};
    const size_t weight_dims[4] = {layer.out_channels, layer.kernel, layer.kernel, in.channels},
                 bias_dims[1] = {layer.out_channels};
    const FixedPointConvolution& convolution = fixed_.convolutions[i];
    uint32_t quantised = 0, weights = 0, bias = 0;
    check(xnn_define_dynamically_quantized_tensor_value(subgraph_, xnn_datatype_qdint8, 4, 3, dims,
                                                        XNN_INVALID_VALUE_ID, 0, &quantised));
    check(xnn_define_unary(subgraph_, xnn_unary_convert, nullptr, ids_[layer.inputs[0]], quantised,
                           0));
    std::vector<int8_t>& copy =
        weights_.emplace_back(convolution.weights.begin(), convolution.weights.end());
    copy.resize(copy.size() + XNN_EXTRA_BYTES);
    check(xnn_define_channelwise_quantized_tensor_value(
        subgraph_, xnn_datatype_qcint8, convolution.weight_scale.data(), 4, 0, weight_dims,
        copy.data(), XNN_INVALID_VALUE_ID, 0, &weights));
    check(xnn_define_tensor_value(
        subgraph_, xnn_datatype_fp32, 1, bias_dims,
        biases_.emplace_back(layer.out_channels + XNN_EXTRA_BYTES / sizeof(float)).data(),
        XNN_INVALID_VALUE_ID, 0, &bias));
    const uint32_t padding = layer.kernel / 2;
    check(xnn_define_convolution_2d(subgraph_, padding, padding, padding, padding, layer.kernel,
                                    layer.kernel, 1, 1, 1, 1, 1, in.channels, layer.out_channels,
                                    layer.relu ? 0.0f : -kInfinity, kInfinity, quantised, weights,
                                    bias, ids_[i + 1], 0));
  }

  void define_layer(size_t i) {
    const Layer& layer = network_.layers[i];
    const uint32_t input = ids_[layer.inputs[0]], output = ids_[i + 1];
    switch (layer.op) {
      case LayerOp::kConv2d:
        return define_convolution(i);
      case LayerOp::kMaxPool2:
        return check(xnn_define_max_pooling_2d(subgraph_, 0, 0, 0, 0, 2, 2, 2, 2, 1, 1, -kInfinity,
                                               kInfinity, input, output, 0));
      case LayerOp::kUpsample2:
        return check(xnn_define_static_resize_bilinear_2d(subgraph_, shapes_[i + 1].size,
                                                          shapes_[i + 1].size, input, output, 0));
      case LayerOp::kConcat:
        return check(
            xnn_define_concatenate2(subgraph_, 3, input, ids_[layer.inputs[1]], output, 0));
    }
  }

  const Network& network_;
  const FixedPointNetwork& fixed_;
  const std::vector<ValueShape> shapes_;
  std::vector<uint32_t> ids_;
  std::deque<std::vector<int8_t>> weights_;
  std::deque<std::vector<float>> biases_;
  xnn_subgraph_t subgraph_ = nullptr;
};

}  // namespace

DynamicNetwork::DynamicNetwork(const Network& network, const FixedPointNetwork& fixed,
                               ThreadPool& pool) {
  const Builder builder(network, fixed);
  const ValueShape &in = builder.shapes().front(), &out = builder.shapes().back();
  input_count_ = size_t{in.size} * in.size * in.channels;
  FIG_CHECK(
      input_.ensure(input_count_) && output_.ensure(size_t{out.size} * out.size * out.channels),
      "memory");
  xnn_runtime_t runtime = nullptr;
  check(xnn_create_runtime_v4(builder.subgraph(), nullptr, nullptr, pool.network_pool(), 0,
                              &runtime));
  runtime_.reset(runtime);
  check(xnn_reshape_runtime(runtime));
  const xnn_external_value values[2] = {{0, input_.data()}, {1, output_.data()}};
  check(xnn_setup_runtime_v2(runtime, 2, values));
}

void DynamicNetwork::run() { check(xnn_invoke_runtime(runtime_.get())); }

}  // namespace figurine::bench
