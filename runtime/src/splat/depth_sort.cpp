#include "runtime/src/splat/depth_sort.h"

namespace figurine {

bool DepthSort::ensure(size_t count) { return items_[0].ensure(count) && items_[1].ensure(count); }

const DepthSort::Item* DepthSort::sort(size_t count) {
  constexpr uint32_t kMask = kBuckets - 1;
  for (auto& digit : histogram_) digit.fill(0);
  const Item* from = items_[0].data();
  Item* to = items_[1].data();
  for (size_t i = 0; i < count; ++i) {
    for (uint32_t d = 0; d < kDigits; ++d)
      ++histogram_[d][(from[i].depth_bits >> (d * kDigitBits)) & kMask];
  }
  for (uint32_t d = 0; d < kDigits; ++d) {
    const uint32_t shift = d * kDigitBits;
    std::array<uint32_t, kBuckets>& next = histogram_[d];
    // A digit that all keys share moves nothing: usual for the top one, since a person's depths
    // share their exponent.
    if (count == 0 || next[(from[0].depth_bits >> shift) & kMask] == count) continue;
    uint32_t sum = 0;
    for (uint32_t& bucket : next) {
      const uint32_t size = bucket;
      bucket = sum;
      sum += size;
    }
    for (size_t i = 0; i < count; ++i) to[next[(from[i].depth_bits >> shift) & kMask]++] = from[i];
    to = const_cast<Item*>(std::exchange(from, to));
  }
  return from;
}

}  // namespace figurine
