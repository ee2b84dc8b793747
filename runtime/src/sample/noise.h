// Normal random numbers that are the same to the bit on every CPU, in any order and in any cut:
// value i depends on (seed, stream, i) alone (figurine/detail/philox.h).
#pragma once

#include <cstdint>
#include <span>

#include "figurine/detail/philox.h"

namespace figurine {

// Values first, first + 1, ... of a stream. Allocates nothing; costs about a logarithm, a root, a
// sine and a cosine for every two values.
void fill_normal(uint64_t seed, uint64_t stream, std::span<float> values, uint64_t first = 0);

}  // namespace figurine
