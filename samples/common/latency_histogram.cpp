#include "samples/common/latency_histogram.h"

#include <algorithm>
#include <cmath>

namespace figurine::samples {

void LatencyHistogram::add(uint64_t ns) {
  ++count_;
  largest_ns_ = std::max(largest_ns_, ns);
  const uint64_t bin = ns / kBin_ns;
  ++(bin < bins_.size() ? bins_[bin] : beyond_);
}

double LatencyHistogram::percentile_ms(double percent) const {
  const auto rank = std::max<uint64_t>(
      1, static_cast<uint64_t>(std::ceil(percent / 100 * static_cast<double>(count_))));
  uint64_t seen = 0;
  for (size_t bin = 0; bin < bins_.size(); ++bin) {
    seen += bins_[bin];
    if (seen >= rank && count_ > 0)
      return std::min(static_cast<double>((bin + 1) * kBin_ns) * 1e-6, largest_ms());
  }
  return largest_ms();
}

}  // namespace figurine::samples
