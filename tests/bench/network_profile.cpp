#include "bench/network_profile.h"

#include <xnnpack.h>

#include "bench/profile_clock.h"
#include "figurine/check.h"

namespace figurine::bench {
namespace {

struct Run {
  uint64_t stage_begin = 0, begin = 0, stage_end = 0;
  bool over = true;  // the stage's end was seen
};

xnn_runtime_t runtime = nullptr;
uint64_t last_read = 0;
Run run;

std::vector<uint64_t> operator_counts() {
  size_t count = 0, size_bytes = 0;
  xnn_status status = xnn_get_runtime_profiling_info(runtime, xnn_profile_info_num_operators,
                                                     sizeof(count), &count, &size_bytes);
  FIG_CHECK(status == xnn_status_success, "XNNPACK counts its operators");
  std::vector<uint64_t> counts(count);
  status = xnn_get_runtime_profiling_info(runtime, xnn_profile_info_operator_timing,
                                          count * sizeof(uint64_t), counts.data(), &size_bytes);
  FIG_CHECK(status == xnn_status_success, "XNNPACK times its operators");
  return counts;
}

LayerCost describe(const Network& network, const std::vector<ValueShape>& shapes, size_t i) {
  const Layer& layer = network.layers[i];
  const uint32_t in = shapes[layer.inputs[0]].channels;
  const auto [size, out] = shapes[i + 1];
  const std::string side = std::to_string(size), channels = std::to_string(out) + " channels, ",
                    where = side + "x" + side;
  switch (layer.op) {
    case LayerOp::kConv2d: {
      const std::string kernel = std::to_string(layer.kernel);
      return {.name = kernel + "x" + kernel + ", " + std::to_string(in) + " to " + channels + where,
              .macs = uint64_t{size} * size * layer.kernel * layer.kernel * in * out};
    }
    case LayerOp::kMaxPool2:
      return {.name = "max pool, " + channels + where};
    case LayerOp::kUpsample2:
      return {.name = "bilinear, " + channels + where};
    case LayerOp::kConcat:
      return {.name = "concatenation, " + channels + where};
  }
  return {};
}

}  // namespace

uint64_t read_stage_clock(void*) {
  last_read = read_clock();
  if (!run.over) {
    run.stage_end = last_read;
    run.over = true;
  }
  return last_read;
}

Result<std::vector<LayerCost>> last_run(const Network& network) {
  FIG_CHECK(runtime != nullptr && run.over, "a network has run, by the stage clock");
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  const std::vector<uint64_t> counts = operator_counts();
  std::vector<LayerCost> layers;
  size_t next = 0;
  uint64_t in_operators = 0;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    LayerCost& cost = layers.emplace_back(describe(network, shapes, i));
    if (i == 0) {
      cost.count = run.begin - run.stage_begin;
    } else if (i + 1 == network.layers.size()) {
      // With what XNNPACK does besides its operators, a few hundred instructions.
      cost.count = run.stage_end - run.begin - in_operators;
    } else {
      cost.count = next < counts.size() ? counts[next] : 0;
      ++next;
      in_operators += cost.count;
    }
  }
  if (next != counts.size()) {
    return Status(StatusCode::kMismatch, "XNNPACK runs " + std::to_string(counts.size()) +
                                             " operators, the layers are " + std::to_string(next));
  }
  return layers;
}

}  // namespace figurine::bench

extern "C" {

xnn_status __real_xnn_create_runtime_v4(xnn_subgraph_t, xnn_weights_cache_t, xnn_workspace_t,
                                        pthreadpool_t, uint32_t, xnn_runtime_t*);
xnn_status __wrap_xnn_create_runtime_v4(xnn_subgraph_t subgraph, xnn_weights_cache_t cache,
                                        xnn_workspace_t workspace, pthreadpool_t pool,
                                        uint32_t flags, xnn_runtime_t* created) {
  const xnn_status status = __real_xnn_create_runtime_v4(subgraph, cache, workspace, pool,
                                                         flags | XNN_FLAG_BASIC_PROFILING, created);
  if (status == xnn_status_success) figurine::bench::runtime = *created;
  return status;
}

xnn_status __real_xnn_invoke_runtime(xnn_runtime_t);
xnn_status __wrap_xnn_invoke_runtime(xnn_runtime_t invoked) {
  figurine::bench::run = {.stage_begin = figurine::bench::last_read,
                          .begin = figurine::bench::read_clock(),
                          .over = false};
  return __real_xnn_invoke_runtime(invoked);
}

}  // extern "C"
