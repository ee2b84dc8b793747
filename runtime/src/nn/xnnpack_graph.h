// From a figurine::Network to an XNNPACK runtime: the way that float and fixed point share. A
// derived builder says how a value and a convolution's weights are defined; everything else follows
// from the layers.
#pragma once

#include <xnnpack.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "figurine/network.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/nn/xnnpack_runtime.h"

namespace figurine {

static_assert(kBufferPadding >= XNN_EXTRA_BYTES);

// OK, kOutOfMemory or kUnsupported, "XNNPACK: what: reason".
Status xnnpack_status(xnn_status status, const char* what);
// Idempotent and thread-safe.
Status initialize_xnnpack();
// The pool that XNNPACK's loops can use: null, one thread, where they are another library's than
// the pool is, as in a process that had loaded XNNPACK before it loaded us and our drop-in. After
// initialize_xnnpack().
pthreadpool* xnnpack_pool(const ThreadPool& pool);

// Copies of weights that live until they are packed: packing may read past the end, and a mapped
// package may end with its page.
class PaddedCopies {
 public:
  static size_t padded(size_t size_bytes) {
    return (size_bytes + XNN_EXTRA_BYTES + kBufferAlignment - 1) / kBufferAlignment *
           kBufferAlignment;
  }
  // Room for copies whose padded sizes sum to size_bytes.
  bool reserve(size_t size_bytes) { return bytes_.ensure(size_bytes); }
  template <class T>
  const T* copy(std::span<const T> values) {
    T* to = reinterpret_cast<T*>(bytes_.data() + used_);
    std::memcpy(to, values.data(), values.size_bytes());
    used_ += padded(values.size_bytes());
    return to;
  }

 private:
  Buffer<std::byte> bytes_;
  size_t used_ = 0;
};

uint64_t element_count(const ValueShape& shape);

// Which values the result depends on. Value 0 is the input.
std::vector<bool> find_needed(const Network& network);

// The part of a network that XNNPACK evaluates.
struct GraphPlan {
  std::vector<bool> made;        // [layers + 1] values that it makes
  std::vector<uint32_t> inputs;  // values that it is given
  uint32_t output = 0;           // the value that it gives back
};

class GraphBuilder {
 public:
  GraphBuilder(const Network& network, const std::vector<ValueShape>& shapes, const GraphPlan& plan)
      : network_(network), shapes_(shapes), plan_(plan) {}
  virtual ~GraphBuilder() = default;

  // Builds, packs, plans, and points at the fixed buffers of the plan's inputs, then its output.
  // Nothing of the builder is needed afterwards. estimated_bytes: estimate_xnnpack_bytes().
  Status build(std::span<void* const> buffers, uint64_t estimated_bytes, ThreadPool& pool,
               XnnRuntime& runtime);

 protected:
  // Room in copies_ for all weights.
  virtual Status reserve_copies() = 0;
  virtual xnn_status define_value(size_t value, const size_t (&dims)[4], uint32_t external_id,
                                  uint32_t flags, uint32_t& id) = 0;
  virtual xnn_status define_weights(size_t layer, const size_t (&dims)[4], uint32_t& id) = 0;
  virtual xnn_status define_bias(size_t layer, const size_t (&dims)[1], uint32_t& id) = 0;

  xnn_subgraph* subgraph() const { return subgraph_.get(); }
  const Network& network() const { return network_; }
  PaddedCopies& copies() { return copies_; }

 private:
  struct SubgraphDeleter {
    void operator()(xnn_subgraph* subgraph) const { xnn_delete_subgraph(subgraph); }
  };
  Status define_values();
  Status define_layer(size_t i);
  Status define_convolution(size_t i);

  const Network& network_;
  const std::vector<ValueShape>& shapes_;
  const GraphPlan& plan_;
  PaddedCopies copies_;
  std::vector<uint32_t> ids_;
  std::unique_ptr<xnn_subgraph, SubgraphDeleter> subgraph_;
};

// What XNNPACK holds for a plan: packed weights, the intermediate values that are alive at the same
// time, and one pointer per tap and pixel of every 3x3 convolution and resize.
uint64_t estimate_xnnpack_bytes(const Network& network, const std::vector<ValueShape>& shapes,
                                const GraphPlan& plan, size_t element_bytes);

}  // namespace figurine
