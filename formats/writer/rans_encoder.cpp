#include "formats/writer/rans_encoder.h"

#include <algorithm>
#include <numeric>

#include "figurine/check.h"

namespace figurine {

std::array<int16_t, kRansValues> normalise_counts(std::span<const uint64_t> counts) {
  std::array<int64_t, kRansValues> frequency{};
  const uint64_t total = std::accumulate(counts.begin(), counts.end(), uint64_t{0});
  if (total == 0) frequency[127] = kRansTotal;
  for (size_t k = 0; k < kRansValues && total != 0; ++k) {
    if (counts[k] != 0)
      frequency[k] = std::max<int64_t>(
          1, static_cast<int64_t>(double(counts[k]) / double(total) * kRansTotal));
  }
  // Rounding is made good where it matters least: one by one at the most frequent value of the
  // moment.
  for (int64_t left =
           int64_t{kRansTotal} - std::accumulate(frequency.begin(), frequency.end(), int64_t{0});
       left != 0;) {
    const int64_t step = left > 0 ? 1 : -1;
    *std::max_element(frequency.begin(), frequency.end()) += step;
    left -= step;
  }
  std::array<int16_t, kRansValues> result{};
  std::transform(frequency.begin(), frequency.end(), result.begin(),
                 [](int64_t f) { return static_cast<int16_t>(f); });
  return result;
}

std::vector<uint8_t> encode_rans(std::span<const RansStretch> stretches) {
  std::vector<uint8_t> reversed;
  uint32_t state = kRansLow;
  for (size_t s = stretches.size(); s-- > 0;) {
    const RansTable& table = *stretches[s].table;
    for (size_t i = stretches[s].values.size(); i-- > 0;) {
      const auto k = static_cast<size_t>(stretches[s].values[i] + 127);
      const uint32_t frequency = table.frequency[k];
      FIG_CHECK(frequency > 0, "a value that the table knows");
      const uint32_t most = (kRansLow >> kRansBits << 8) * frequency;
      for (; state >= most; state >>= 8) reversed.push_back(static_cast<uint8_t>(state));
      state = (state / frequency << kRansBits) + state % frequency + table.start[k];
    }
  }
  for (int shift = 24; shift >= 0; shift -= 8)
    reversed.push_back(static_cast<uint8_t>(state >> shift));
  std::reverse(reversed.begin(), reversed.end());
  return reversed;
}

}  // namespace figurine
