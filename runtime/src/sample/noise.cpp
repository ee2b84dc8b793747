#include "runtime/src/sample/noise.h"

namespace figurine {

void fill_normal(uint64_t seed, uint64_t stream, std::span<float> values, uint64_t first) {
  for (size_t i = 0; i < values.size();) {
    const uint64_t index = first + i;
    const std::array<double, 4> normal = stream_normals(seed, stream, index / 4);
    for (size_t k = index % 4; k < 4 && i < values.size(); ++k)
      values[i++] = static_cast<float>(normal[k]);
  }
}

}  // namespace figurine
