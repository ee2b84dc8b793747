// The other side of figurine/detail/rans.h.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "figurine/detail/rans.h"

namespace figurine {

// Frequencies of sum kRansTotal in proportion to the counts, at least 1 for every value that
// occurs; of nothing at all, those of zeros.
std::array<int16_t, kRansValues> normalise_counts(std::span<const uint64_t> counts);

// A stretch of values that share a table. values: [-127, 127], each of a frequency above 0.
struct RansStretch {
  std::span<const int8_t> values;
  const RansTable* table = nullptr;
};
// The stream that decodes to the stretches in their order.
std::vector<uint8_t> encode_rans(std::span<const RansStretch> stretches);

}  // namespace figurine
