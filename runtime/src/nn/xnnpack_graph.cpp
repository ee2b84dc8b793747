#include "runtime/src/nn/xnnpack_graph.h"

#include <algorithm>
#include <limits>
#include <string>

#include "runtime/src/base/drop_in_pthreadpool.h"
#include "runtime/src/nn/xnnpack_memory.h"

namespace figurine {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Two numbers copied by XNNPACK without a pool: a loop that the drop-in counts if it is its own.
bool loops_are_of(const DropInPthreadpool& drop_in) {
  const uint32_t from[] = {1, 2, 3, 4};
  uint32_t to[] = {0, 0};
  const uint64_t before = drop_in.loops_alone();
  const xnn_status status = xnn_run_copy_nc_x32(1, 2, 1, 2, from, to, 0, nullptr);
  return status == xnn_status_success && drop_in.loops_alone() != before;
}

}  // namespace

Status xnnpack_status(xnn_status status, const char* what) {
  switch (status) {
    case xnn_status_success:
      return {};
    case xnn_status_out_of_memory:
      return Status(StatusCode::kOutOfMemory, std::string("XNNPACK: ") + what + ": no memory");
    case xnn_status_unsupported_hardware:
      return Status(StatusCode::kUnsupported,
                    std::string("XNNPACK: ") + what + ": unsupported hardware");
    default:
      return Status(StatusCode::kUnsupported, std::string("XNNPACK: ") + what + ": status " +
                                                  std::to_string(static_cast<int>(status)));
  }
}

Status initialize_xnnpack() {
  // It asks cpuinfo for the CPU, which on Linux reads files; on ARM it gives up without the lists
  // of CPUs in /sys, which containers and phones may hide.
  // What it needs for that is not asked for by its allocator, and if it is not had once it is not
  // asked for again.
  constexpr size_t kStartBytes = 64 << 10;
  if (!MemoryReserve(kStartBytes).held()) return out_of_memory("starting XNNPACK");
  const xnn_status status = xnn_initialize(&xnnpack_allocator());
  if (status == xnn_status_success) return {};
  Status error = xnnpack_status(status, "cannot start");
  if (status == xnn_status_out_of_memory) return error;
  return Status(error.code(), error.message() +
                                  "; it identifies the CPU by /proc/cpuinfo and by possible or "
                                  "present in /sys/devices/system/cpu: are they there to read?");
}

pthreadpool* xnnpack_pool(const ThreadPool& pool) {
  if (figurine_drop_in_pthreadpool == nullptr) return pool.network_pool();
  static const bool same_library = loops_are_of(*figurine_drop_in_pthreadpool());
  return same_library ? pool.network_pool() : nullptr;
}

void XnnRuntimeDeleter::operator()(xnn_runtime* runtime) const { xnn_delete_runtime(runtime); }

Status GraphBuilder::build(std::span<void* const> buffers, uint64_t estimated_bytes,
                           ThreadPool& pool, XnnRuntime& runtime) {
  FIG_RETURN_IF_ERROR(reserve_copies());
  // Of all that XNNPACK takes: packed weights and the rest that can be told beforehand, and beside
  // it what it knows of each layer.
  constexpr size_t kOfLayer = 16 << 10;
  const XnnpackRoom room(estimated_bytes * 5 / 4 + kOfLayer * (network_.layers.size() + 4));
  if (!room.held()) return out_of_memory("a network");
  const uint32_t external_count = static_cast<uint32_t>(plan_.inputs.size()) + 1;
  FIG_CHECK(buffers.size() == external_count, "a buffer for every input and the output");
  xnn_subgraph_t subgraph = nullptr;
  FIG_RETURN_IF_ERROR(
      xnnpack_status(xnn_create_subgraph(external_count, 0, &subgraph), "creating a subgraph"));
  subgraph_.reset(subgraph);
  FIG_RETURN_IF_ERROR(define_values());
  for (size_t i = 0; i < network_.layers.size(); ++i) {
    if (plan_.made[i + 1])
      FIG_RETURN_IF_ERROR(define_layer(i).within("layer " + std::to_string(i)));
  }
  xnn_runtime_t created = nullptr;
  const xnn_status packed = xnn_create_runtime_v4(subgraph, nullptr, nullptr, xnnpack_pool(pool),
                                                  XNN_FLAG_YIELD_WORKERS, &created);
  runtime.reset(created);
  FIG_RETURN_IF_ERROR(xnnpack_status(packed, "packing the network"));
  FIG_RETURN_IF_ERROR(xnnpack_status(xnn_reshape_runtime(created), "planning the network"));
  std::vector<xnn_external_value> values;
  for (uint32_t id = 0; id < external_count; ++id) values.push_back({id, buffers[id]});
  return xnnpack_status(xnn_setup_runtime_v2(created, values.size(), values.data()),
                        "setting up the network");
}

Status GraphBuilder::define_values() {
  ids_.assign(shapes_.size(), XNN_INVALID_VALUE_ID);
  const auto define = [&](uint32_t value, uint32_t external_id, uint32_t flags) {
    const ValueShape& shape = shapes_[value];
    return xnnpack_status(define_value(value, {1, shape.size, shape.size, shape.channels},
                                       external_id, flags, ids_[value]),
                          "defining a value");
  };
  for (uint32_t id = 0; id < plan_.inputs.size(); ++id) {
    FIG_RETURN_IF_ERROR(define(plan_.inputs[id], id, XNN_VALUE_FLAG_EXTERNAL_INPUT));
  }
  for (uint32_t value = 0; value < shapes_.size(); ++value) {
    if (!plan_.made[value]) continue;
    const bool is_output = value == plan_.output;
    FIG_RETURN_IF_ERROR(
        define(value, is_output ? static_cast<uint32_t>(plan_.inputs.size()) : XNN_INVALID_VALUE_ID,
               is_output ? XNN_VALUE_FLAG_EXTERNAL_OUTPUT : 0));
  }
  return {};
}

Status GraphBuilder::define_layer(size_t i) {
  const Layer& layer = network_.layers[i];
  const uint32_t input = ids_[layer.inputs[0]], output = ids_[i + 1], size = shapes_[i + 1].size;
  switch (layer.op) {
    case LayerOp::kConv2d:
      return define_convolution(i);
    case LayerOp::kMaxPool2:
      return xnnpack_status(xnn_define_max_pooling_2d(subgraph_.get(), 0, 0, 0, 0, 2, 2, 2, 2, 1, 1,
                                                      -kInfinity, kInfinity, input, output, 0),
                            "max pool");
    case LayerOp::kUpsample2:
      // No flag: half-pixel centres without aligned corners, borders repeated. The flags would be
      // TensorFlow's legacy mode and align_corners.
      return xnnpack_status(
          xnn_define_static_resize_bilinear_2d(subgraph_.get(), size, size, input, output, 0),
          "resize");
    case LayerOp::kConcat:
      return xnnpack_status(
          xnn_define_concatenate2(subgraph_.get(), 3, input, ids_[layer.inputs[1]], output, 0),
          "concatenation");
  }
  return Status(StatusCode::kUnsupported, "unknown operator");
}

Status GraphBuilder::define_convolution(size_t i) {
  const Layer& layer = network_.layers[i];
  const uint32_t in_channels = shapes_[layer.inputs[0]].channels, padding = layer.kernel / 2;
  uint32_t weights = 0, bias = 0;
  FIG_RETURN_IF_ERROR(xnnpack_status(
      define_weights(i, {layer.out_channels, layer.kernel, layer.kernel, in_channels}, weights),
      "defining weights"));
  FIG_RETURN_IF_ERROR(
      xnnpack_status(define_bias(i, {layer.out_channels}, bias), "defining a bias"));
  return xnnpack_status(
      xnn_define_convolution_2d(subgraph_.get(), padding, padding, padding, padding, layer.kernel,
                                layer.kernel, 1, 1, 1, 1, 1, in_channels, layer.out_channels,
                                layer.relu ? 0.0f : -kInfinity, kInfinity, ids_[layer.inputs[0]],
                                weights, bias, ids_[i + 1], 0),
      "convolution");
}

uint64_t element_count(const ValueShape& shape) {
  return uint64_t(shape.size) * shape.size * shape.channels;
}

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

uint64_t estimate_xnnpack_bytes(const Network& network, const std::vector<ValueShape>& shapes,
                                const GraphPlan& plan, size_t element_bytes) {
  std::vector<size_t> last_use(shapes.size(), 0);
  uint64_t bytes = 0;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (!plan.made[i + 1]) continue;
    last_use[layer.inputs[0]] = i;
    if (layer.op == LayerOp::kConcat) last_use[layer.inputs[1]] = i;
    const uint64_t pixels = uint64_t(shapes[i + 1].size) * shapes[i + 1].size;
    if (layer.op == LayerOp::kConv2d) {
      const uint64_t taps =
          uint64_t{layer.kernel} * layer.kernel * shapes[layer.inputs[0]].channels;
      bytes += layer.out_channels * (taps * element_bytes + sizeof(float));
      if (layer.kernel == 3) bytes += pixels * 9 * sizeof(void*);
    }
    if (layer.op == LayerOp::kMaxPool2) bytes += pixels * 4 * sizeof(void*);
    if (layer.op == LayerOp::kUpsample2) bytes += pixels * (4 * sizeof(void*) + 2 * sizeof(float));
  }
  uint64_t peak = 0;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    uint64_t alive = 0;
    for (size_t value = 1; value <= i + 1; ++value) {
      if (plan.made[value] && value != plan.output && (value == i + 1 || last_use[value] >= i))
        alive += element_count(shapes[value]) * element_bytes;
    }
    peak = std::max(peak, alive);
  }
  return bytes + peak;
}

}  // namespace figurine
