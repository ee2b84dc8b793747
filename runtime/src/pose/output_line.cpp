#include "runtime/src/pose/output_line.h"

#include <algorithm>

namespace figurine {

bool OutputLine::begin_at(std::span<const float> outputs) {
  begun_ = from_.ensure(outputs.size()) && outputs_.ensure(outputs.size());
  if (begun_) std::copy(outputs.begin(), outputs.end(), from_.data());
  return begun_;
}

void OutputLine::go_on(std::span<const float> last, float steps) {
  const float* const from = from_.data();
  float* const to = outputs_.data();
  for (size_t i = 0; i < last.size(); ++i) to[i] = last[i] + steps * (last[i] - from[i]);
}

}  // namespace figurine
