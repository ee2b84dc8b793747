#include "runtime/src/nn/network_runner.h"

#include <new>
#include <string>
#include <vector>

#include "runtime/src/nn/xnnpack_graph.h"

namespace figurine {
namespace {

class FloatGraphBuilder : public GraphBuilder {
 public:
  using GraphBuilder::GraphBuilder;

 private:
  Status reserve_copies() override {
    size_t size_bytes = 0;
    for (const Layer& layer : network().layers) {
      size_bytes += PaddedCopies::padded(layer.weights.size_bytes()) +
                    PaddedCopies::padded(layer.bias.size_bytes());
    }
    return copies().reserve(size_bytes) ? Status() : out_of_memory("the network's weights");
  }

  xnn_status define_value(size_t, const size_t (&dims)[4], uint32_t external_id, uint32_t flags,
                          uint32_t& id) override {
    return xnn_define_tensor_value(subgraph(), xnn_datatype_fp32, 4, dims, nullptr, external_id,
                                   flags, &id);
  }
  xnn_status define_weights(size_t layer, const size_t (&dims)[4], uint32_t& id) override {
    return define_constant(network().layers[layer].weights, dims, id);
  }
  xnn_status define_bias(size_t layer, const size_t (&dims)[1], uint32_t& id) override {
    return define_constant(network().layers[layer].bias, dims, id);
  }
  xnn_status define_constant(std::span<const float> values, std::span<const size_t> dims,
                             uint32_t& id) {
    return xnn_define_tensor_value(subgraph(), xnn_datatype_fp32, dims.size(), dims.data(),
                                   copies().copy(values), XNN_INVALID_VALUE_ID, 0, &id);
  }
};

}  // namespace

Result<std::unique_ptr<NetworkRunner>> NetworkRunner::create(const Network& network,
                                                             ThreadPool& pool) {
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
  if (!runner->input_.ensure(runner->input_count_) ||
      !runner->output_.ensure(runner->output_count_))
    return out_of_memory("a network's input and output");

  GraphPlan plan{.made = find_needed(network),
                 .inputs = {0},
                 .output = static_cast<uint32_t>(network.layers.size())};
  plan.made[0] = false;
  runner->xnnpack_bytes_ = estimate_xnnpack_bytes(network, shapes, plan, sizeof(float));
  void* const buffers[] = {runner->input_.data(), runner->output_.data()};
  FIG_RETURN_IF_ERROR(FloatGraphBuilder(network, shapes, plan)
                          .build(buffers, runner->xnnpack_bytes_, pool, runner->runtime_)
                          .within("network"));
  return runner;
}

Status NetworkRunner::run() {
  return xnnpack_status(xnn_invoke_runtime(runtime_.get()), "running the network");
}

uint64_t NetworkRunner::memory_bytes() const {
  return input_.memory_bytes() + output_.memory_bytes() + xnnpack_bytes_;
}

}  // namespace figurine
