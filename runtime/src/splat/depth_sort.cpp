#include "runtime/src/splat/depth_sort.h"

#include <algorithm>
#include <utility>

namespace figurine {
namespace {

constexpr uint32_t kItemsPerSection = 16384;  // fewer are not worth a thread's waking

}  // namespace

bool DepthSort::ensure(size_t count) {
  return items_[0].ensure(count) && items_[1].ensure(count) &&
         histograms_.ensure(size_t{pool_.threads()} * kDigits);
}

DepthSort::Range DepthSort::range_of(uint32_t section) const {
  const auto first = [&](uint32_t s) {
    return static_cast<uint32_t>(uint64_t{count_} * s / sections_);
  };
  return {first(section), first(section + 1)};
}

// Whether all items share a digit: usual for the top one, since a person's depths share their
// exponent. Sorting by it would move nothing.
bool DepthSort::all_share(const Item& first, uint32_t digit) {
  uint32_t sharing = 0;
  for (uint32_t section = 0; section < sections_; ++section) {
    sharing += histograms(section)[digit][digit_of(first, digit)];
  }
  return sharing == count_;
}

// Every section's counts of a digit become where its first item of each bucket goes.
void DepthSort::turn_into_cursors(uint32_t digit) {
  uint32_t sum = 0;
  for (uint32_t bucket = 0; bucket < kBuckets; ++bucket) {
    for (uint32_t section = 0; section < sections_; ++section) {
      sum += std::exchange(histograms(section)[digit][bucket], sum);
    }
  }
}

const DepthSort::Item* DepthSort::sort(uint32_t count) {
  count_ = count;
  sections_ = std::clamp(count / kItemsPerSection, 1u, pool_.threads());
  const Item* from = items_[0].data();
  Item* to = items_[1].data();
  if (count == 0) return from;

  pool_.for_each(sections_, [&](size_t s) {
    const Range range = range_of(static_cast<uint32_t>(s));
    Histogram* const counts = histograms(static_cast<uint32_t>(s));
    for (uint32_t d = 0; d < kDigits; ++d) counts[d].fill(0);
    for (uint32_t i = range.begin; i < range.end; ++i) {
      for (uint32_t d = 0; d < kDigits; ++d) ++counts[d][digit_of(from[i], d)];
    }
  });
  bool as_counted = true;  // whether the items still stand in the sections that counted them
  for (uint32_t d = 0; d < kDigits; ++d) {
    if (all_share(from[0], d)) continue;
    if (!as_counted && sections_ > 1) {
      pool_.for_each(sections_, [&](size_t s) {
        const Range range = range_of(static_cast<uint32_t>(s));
        Histogram& counts = histograms(static_cast<uint32_t>(s))[d];
        counts.fill(0);
        for (uint32_t i = range.begin; i < range.end; ++i) ++counts[digit_of(from[i], d)];
      });
    }
    turn_into_cursors(d);
    pool_.for_each(sections_, [&](size_t s) {
      const Range range = range_of(static_cast<uint32_t>(s));
      Histogram& next = histograms(static_cast<uint32_t>(s))[d];
      for (uint32_t i = range.begin; i < range.end; ++i) to[next[digit_of(from[i], d)]++] = from[i];
    });
    to = const_cast<Item*>(std::exchange(from, to));
    as_counted = false;
  }
  return from;
}

}  // namespace figurine
