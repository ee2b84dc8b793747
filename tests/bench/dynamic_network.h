// The network with int8 weights and activations whose ranges are found at run time (XNNPACK's
// qd8_f32_qc8w): what fixed point is measured against. Values between the layers are float; its
// results differ between CPUs, so the runtime has no use for it.
#pragma once

#include <memory>
#include <span>

#include "figurine/fixed_point.h"
#include "figurine/network.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/nn/xnnpack_runtime.h"

namespace figurine::bench {

class DynamicNetwork {
 public:
  // Weights and their scales of fixed; biases of zero. Aborts on failure.
  DynamicNetwork(const Network& network, const FixedPointNetwork& fixed, ThreadPool& pool);

  std::span<float> input() { return input_.span(input_count_); }  // [T,T,C]
  void run();

 private:
  Buffer<float> input_, output_;
  size_t input_count_ = 0;
  XnnRuntime runtime_;
};

}  // namespace figurine::bench
