#include "runtime/src/nn/network_runner.h"

#include <xnnpack.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <vector>

namespace figurine {
namespace {

static_assert(kBufferPadding >= XNN_EXTRA_BYTES);

Status error_of(xnn_status status, const char* what) {
  switch (status) {
    case xnn_status_success:
      return {};
    case xnn_status_out_of_memory:
      return Status(StatusCode::kOutOfMemory, std::string("XNNPACK: ") + what + ": no memory");
    case xnn_status_unsupported_hardware:
      return Status(StatusCode::kUnsupported, std::string("XNNPACK: ") + what + ": unsupported hardware");
    default:
      return Status(StatusCode::kUnsupported, std::string("XNNPACK: ") + what + ": status " + std::to_string(static_cast<int>(status)));
  }
}

Status initialize_xnnpack() {
  // Idempotent and thread-safe. It asks cpuinfo for the CPU, which on Linux means reading /proc.
  const xnn_status status = xnn_initialize(nullptr);
  if (status == xnn_status_success) return {};
  Status error = error_of(status, "cannot start");
  if (status == xnn_status_out_of_memory) return error;
  return Status(error.code(), error.message() + "; it identifies the CPU through /proc, is that mounted?");
}

// Which values the result depends on. Value 0 is the input.
std::vector<bool> find_needed(const Network& network) {
  std::vector<bool> needed(network.layers.size() + 1, false);
  needed.back() = true;
  for (size_t i = network.layers.size(); i-- > 0;) {
    if (!needed[i + 1]) continue;
    needed[network.layers[i].inputs[0]] = true;
    if (network.layers[i].op == LayerOp::kConcat) needed[network.layers[i].inputs[1]] = true;
  }
  return needed;
}

uint64_t element_count(const ValueShape& shape) { return uint64_t(shape.size) * shape.size * shape.channels; }

// What XNNPACK holds for the network: packed weights, the intermediate values that are alive at the same time, and one pointer per tap and
// pixel of every 3x3 convolution and resize.
uint64_t estimate_xnnpack_bytes(const Network& network, const std::vector<ValueShape>& shapes, const std::vector<bool>& needed) {
  std::vector<size_t> last_use(shapes.size(), 0);
  uint64_t bytes = 0;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (!needed[i + 1]) continue;
    last_use[layer.inputs[0]] = i;
    if (layer.op == LayerOp::kConcat) last_use[layer.inputs[1]] = i;
    const uint64_t pixels = uint64_t(shapes[i + 1].size) * shapes[i + 1].size;
    if (layer.op == LayerOp::kConv2d) {
      bytes += (layer.weights.size() + layer.bias.size()) * sizeof(float);
      if (layer.kernel == 3) bytes += pixels * 9 * sizeof(void*);
    }
    if (layer.op == LayerOp::kMaxPool2) bytes += pixels * 4 * sizeof(void*);
    if (layer.op == LayerOp::kUpsample2) bytes += pixels * (4 * sizeof(void*) + 2 * sizeof(float));
  }
  uint64_t peak = 0;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    uint64_t alive = 0;
    for (size_t value = 1; value + 1 < shapes.size() && value <= i + 1; ++value) {
      if (needed[value] && (value == i + 1 || last_use[value] >= i)) alive += element_count(shapes[value]) * sizeof(float);
    }
    peak = std::max(peak, alive);
  }
  return bytes + peak;
}

// Deletes the subgraph on every way out; the runtime keeps what it needs.
struct SubgraphDeleter {
  void operator()(xnn_subgraph* subgraph) const { xnn_delete_subgraph(subgraph); }
};

class GraphBuilder {
 public:
  GraphBuilder(const Network& network, const std::vector<ValueShape>& shapes, const std::vector<bool>& needed)
      : network_(network), shapes_(shapes), needed_(needed) {}

  Status build() {
    FIG_RETURN_IF_ERROR(copy_weights());
    xnn_subgraph_t subgraph = nullptr;
    FIG_RETURN_IF_ERROR(error_of(xnn_create_subgraph(2, 0, &subgraph), "creating a subgraph"));
    subgraph_.reset(subgraph);
    ids_.assign(shapes_.size(), XNN_INVALID_VALUE_ID);
    for (size_t value = 0; value < shapes_.size(); ++value) {
      if (needed_[value] || value == 0) FIG_RETURN_IF_ERROR(define_value(value));
    }
    for (size_t i = 0; i < network_.layers.size(); ++i) {
      if (needed_[i + 1]) FIG_RETURN_IF_ERROR(define_layer(i).within("layer " + std::to_string(i)));
    }
    return {};
  }

  xnn_subgraph_t subgraph() const { return subgraph_.get(); }

 private:
  // Packing may read past the end of the weights, and a mapped package may end with its page: hence padded copies, dropped once they are
  // packed.
  Status copy_weights() {
    size_t count = 0;
    for (const Layer& layer : network_.layers) count += padded(layer.weights.size()) + padded(layer.bias.size());
    if (!weights_.ensure(count)) return out_of_memory("the network's weights");
    return {};
  }
  static size_t padded(size_t count) { return (count + XNN_EXTRA_BYTES / sizeof(float) + 15) / 16 * 16; }

  const float* copy(std::span<const float> values) {
    float* to = weights_.data() + used_;
    std::memcpy(to, values.data(), values.size_bytes());
    used_ += padded(values.size());
    return to;
  }

  Status define_value(size_t value) {
    const ValueShape& shape = shapes_[value];
    const size_t dims[4] = {1, shape.size, shape.size, shape.channels};
    const bool is_input = value == 0, is_output = value + 1 == shapes_.size();
    const uint32_t external_id = is_input ? 0 : is_output ? 1 : XNN_INVALID_VALUE_ID;
    const uint32_t flags = is_input ? XNN_VALUE_FLAG_EXTERNAL_INPUT : is_output ? XNN_VALUE_FLAG_EXTERNAL_OUTPUT : 0;
    return error_of(xnn_define_tensor_value(subgraph_.get(), xnn_datatype_fp32, 4, dims, nullptr, external_id, flags, &ids_[value]),
                    "defining a value");
  }

  Status define_layer(size_t i) {
    const Layer& layer = network_.layers[i];
    const uint32_t input = ids_[layer.inputs[0]], output = ids_[i + 1];
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    switch (layer.op) {
      case LayerOp::kConv2d: {
        const size_t in_channels = shapes_[layer.inputs[0]].channels;
        const size_t filter_dims[4] = {layer.out_channels, layer.kernel, layer.kernel, in_channels}, bias_dims[1] = {layer.out_channels};
        uint32_t filter = 0, bias = 0;
        FIG_RETURN_IF_ERROR(error_of(xnn_define_tensor_value(subgraph_.get(), xnn_datatype_fp32, 4, filter_dims, copy(layer.weights),
                                                             XNN_INVALID_VALUE_ID, 0, &filter),
                                     "defining weights"));
        FIG_RETURN_IF_ERROR(error_of(
            xnn_define_tensor_value(subgraph_.get(), xnn_datatype_fp32, 1, bias_dims, copy(layer.bias), XNN_INVALID_VALUE_ID, 0, &bias),
            "defining a bias"));
        const uint32_t padding = layer.kernel / 2;
        return error_of(xnn_define_convolution_2d(subgraph_.get(), padding, padding, padding, padding, layer.kernel, layer.kernel, 1, 1, 1,
                                                  1, 1, in_channels, layer.out_channels, layer.relu ? 0.0f : -kInfinity, kInfinity, input,
                                                  filter, bias, output, 0),
                        "convolution");
      }
      case LayerOp::kMaxPool2:
        return error_of(xnn_define_max_pooling_2d(subgraph_.get(), 0, 0, 0, 0, 2, 2, 2, 2, 1, 1, -kInfinity, kInfinity, input, output, 0),
                        "max pool");
      case LayerOp::kUpsample2:
        // No flag: half-pixel centres without aligned corners, borders repeated. The flags would be TensorFlow's legacy mode and
        // align_corners.
        return error_of(xnn_define_static_resize_bilinear_2d(subgraph_.get(), shapes_[i + 1].size, shapes_[i + 1].size, input, output, 0),
                        "resize");
      case LayerOp::kConcat:
        return error_of(xnn_define_concatenate2(subgraph_.get(), 3, input, ids_[layer.inputs[1]], output, 0), "concatenation");
    }
    return Status(StatusCode::kUnsupported, "unknown operator");
  }

  const Network& network_;
  const std::vector<ValueShape>& shapes_;
  const std::vector<bool>& needed_;
  Buffer<float> weights_;
  size_t used_ = 0;
  std::vector<uint32_t> ids_;
  std::unique_ptr<xnn_subgraph, SubgraphDeleter> subgraph_;
};

}  // namespace

Result<std::unique_ptr<NetworkRunner>> NetworkRunner::create(const Network& network, ThreadPool& pool) {
  const Result<std::vector<ValueShape>> inferred = infer_shapes(network, true);
  if (!inferred.ok()) return inferred.status();
  const std::vector<ValueShape>& shapes = *inferred;
  FIG_RETURN_IF_ERROR(initialize_xnnpack());

  std::unique_ptr<NetworkRunner> runner(new (std::nothrow) NetworkRunner());
  if (runner == nullptr) return out_of_memory("a network");
  runner->input_count_ = element_count(shapes.front());
  runner->output_count_ = element_count(shapes.back());
  runner->output_shape_ = shapes.back();
  runner->macs_ = count_macs(network, shapes);
  if (!runner->input_.ensure(runner->input_count_) || !runner->output_.ensure(runner->output_count_))
    return out_of_memory("a network's input and output");

  const std::vector<bool> needed = find_needed(network);
  runner->xnnpack_bytes_ = estimate_xnnpack_bytes(network, shapes, needed);
  GraphBuilder graph(network, shapes, needed);
  FIG_RETURN_IF_ERROR(graph.build().within("network"));
  FIG_RETURN_IF_ERROR(
      error_of(xnn_create_runtime_v4(graph.subgraph(), nullptr, nullptr, pool.handle(), 0, &runner->runtime_), "packing the network"));
  FIG_RETURN_IF_ERROR(error_of(xnn_reshape_runtime(runner->runtime_), "planning the network"));
  const xnn_external_value values[2] = {{0, runner->input_.data()}, {1, runner->output_.data()}};
  FIG_RETURN_IF_ERROR(error_of(xnn_setup_runtime_v2(runner->runtime_, 2, values), "setting up the network"));
  return runner;
}

NetworkRunner::~NetworkRunner() {
  if (runtime_ != nullptr) xnn_delete_runtime(runtime_);
}

Status NetworkRunner::run() { return error_of(xnn_invoke_runtime(runtime_), "running the network"); }

uint64_t NetworkRunner::memory_bytes() const { return input_.memory_bytes() + output_.memory_bytes() + xnnpack_bytes_; }

}  // namespace figurine
