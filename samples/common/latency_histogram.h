// How long something took, many times over, in bounded memory: for what runs until told otherwise.
// Bins of 20 microseconds up to two seconds; quantiles are a bin's upper end, so never too low.
#pragma once

#include <array>
#include <cstdint>

namespace figurine::samples {

class LatencyHistogram {
 public:
  void add(uint64_t ns);
  uint64_t count() const { return count_; }
  double largest_ms() const { return static_cast<double>(largest_ns_) * 1e-6; }
  // The nearest rank's, in milliseconds; 0 without any. percent in [0, 100]. What took longer than
  // the bins reach counts as the largest.
  double percentile_ms(double percent) const;

 private:
  static constexpr uint64_t kBin_ns = 20'000;
  std::array<uint64_t, 100'000> bins_{};
  uint64_t beyond_ = 0, count_ = 0, largest_ns_ = 0;
};

}  // namespace figurine::samples
