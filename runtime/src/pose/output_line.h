// A network's outputs after its last run, without another: on in the straight line from those of
// the run before (Approximation::network_interval).
#pragma once

#include <span>

#include "runtime/src/base/memory.h"

namespace figurine {

class OutputLine {
 public:
  // The line comes from these outputs. False: no memory, and there is no line.
  bool begin_at(std::span<const float> outputs);
  void forget() { begun_ = false; }
  bool begun() const { return begun_; }

  // last + steps (last - from), steps being those of the way between the two; of as many numbers as
  // it began with.
  void go_on(std::span<const float> last, float steps);
  const float* outputs() const { return outputs_.data(); }

  uint64_t memory_bytes() const { return from_.memory_bytes() + outputs_.memory_bytes(); }

 private:
  bool begun_ = false;
  Buffer<float> from_, outputs_;
};

}  // namespace figurine
