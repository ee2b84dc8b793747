// Evaluates a figurine::Network in f32 through XNNPACK's subgraph API. NHWC, batch 1. The
// definitions are those of figurine/network.h.
//
// Everything is packed, planned and pointed at fixed buffers once; run() then allocates nothing.
// Layers whose output nobody needs are not built.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/network.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/nn/xnnpack_runtime.h"

namespace figurine {

class NetworkRunner {
 public:
  // The network's weights are read here and not afterwards. The pool must outlive the runner.
  // Errors: kCorrupt of infer_shapes; kUnsupported where XNNPACK cannot run at all or not this
  // network; kOutOfMemory.
  static Result<std::unique_ptr<NetworkRunner>> create(const Network& network, ThreadPool& pool);
  NetworkRunner(const NetworkRunner&) = delete;
  NetworkRunner& operator=(const NetworkRunner&) = delete;

  std::span<float> input() { return input_.span(input_count_); }  // [T,T,C_in], kept between runs
  std::span<const float> output() const {
    return output_.span(output_count_);
  }  // [size,size,channels] of output_shape()
  ValueShape output_shape() const { return output_shape_; }

  Status run();

  uint64_t macs() const { return macs_; }
  uint64_t memory_bytes() const;  // XNNPACK's packed weights, intermediate values and indirection
                                  // pointers are estimated

 private:
  NetworkRunner() = default;

  XnnRuntime runtime_;
  Buffer<float> input_, output_;
  size_t input_count_ = 0, output_count_ = 0;
  ValueShape output_shape_;
  uint64_t macs_ = 0;
  uint64_t xnnpack_bytes_ = 0;
};

}  // namespace figurine
