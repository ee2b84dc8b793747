// A stable radix sort of float depths: ascending, equal depths keep their input order.
//
// All 32 bits of the float count: integer or normalised depths lose neighbours and show as popping.
//
// Based on: Knuth, The Art of Computer Programming 3, 5.2.5 (least-significant-digit radix sort);
// positive floats order as their bits do.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/src/base/memory.h"

namespace figurine {

class DepthSort {
 public:
  bool ensure(size_t count);  // false: no memory

  // Room for the keys to be filled in before sort(); depths are positive and finite.
  struct Item {
    uint32_t depth_bits;
    uint32_t index;
  };
  Item* items() { return items_[0].data(); }

  // The first count items, sorted; valid until the next call.
  const Item* sort(size_t count);

  uint64_t memory_bytes() const {
    return items_[0].memory_bytes() + items_[1].memory_bytes() + sizeof(histogram_);
  }

 private:
  static constexpr uint32_t kDigitBits = 11, kDigits = 3, kBuckets = 1u << kDigitBits;
  Buffer<Item> items_[2];
  std::array<std::array<uint32_t, kBuckets>, kDigits> histogram_;
};

}  // namespace figurine
