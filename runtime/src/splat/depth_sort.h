// A stable radix sort of float depths: ascending, equal depths keep their input order.
//
// All 32 bits of the float count: integer or normalised depths lose neighbours and show as popping.
// Long lists are divided into sections, one a task; a section's items of a digit follow those of
// the sections before it, so the result does not depend on their number.
//
// Based on: Knuth, The Art of Computer Programming 3, 5.2.5 (least-significant-digit radix sort);
// positive floats order as their bits do.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"

namespace figurine {

class DepthSort {
 public:
  explicit DepthSort(ThreadPool& pool) : pool_(pool) {}

  bool ensure(size_t count);  // false: no memory

  // Room for the keys to be filled in before sort(); depths are positive and finite.
  struct Item {
    uint32_t depth_bits;
    uint32_t index;
  };
  Item* items() { return items_[0].data(); }

  // The first count items, sorted; valid until the next call.
  const Item* sort(uint32_t count);

  uint64_t memory_bytes() const {
    return items_[0].memory_bytes() + items_[1].memory_bytes() + histograms_.memory_bytes();
  }

 private:
  static constexpr uint32_t kDigitBits = 11, kDigits = 3, kBuckets = 1u << kDigitBits;
  using Histogram = std::array<uint32_t, kBuckets>;
  struct Range {
    uint32_t begin, end;
  };

  static uint32_t digit_of(const Item& item, uint32_t digit) {
    return (item.depth_bits >> (digit * kDigitBits)) & (kBuckets - 1);
  }
  Range range_of(uint32_t section) const;
  // Of one section, [kDigits] in the order that the items were given in.
  Histogram* histograms(uint32_t section) { return histograms_.data() + size_t{section} * kDigits; }
  bool all_share(const Item& first, uint32_t digit);
  void turn_into_cursors(uint32_t digit);

  ThreadPool& pool_;
  uint32_t count_ = 0, sections_ = 1;
  Buffer<Item> items_[2];
  Buffer<Histogram> histograms_;  // [sections,kDigits]
};

}  // namespace figurine
