// Quantiles out of bins: never below the true ones, and no more than a bin above.
#include "samples/common/latency_histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace figurine::samples::latency_histogram_test {
namespace {

TEST(LatencyHistogram, IsABinFromTheTruthAtMost) {
  std::mt19937 random(1);
  std::exponential_distribution<double> latency(1 / 8e6);
  const auto histogram = std::make_unique<LatencyHistogram>();
  std::vector<uint64_t> all;
  for (int i = 0; i < 5000; ++i) {
    all.push_back(static_cast<uint64_t>(latency(random)));
    histogram->add(all.back());
  }
  std::sort(all.begin(), all.end());
  for (const double percent : {1.0, 50.0, 90.0, 99.0, 100.0}) {
    const auto rank = static_cast<size_t>(std::ceil(percent / 100 * 5000));
    const double truth = static_cast<double>(all[rank - 1]) * 1e-6;
    EXPECT_GE(histogram->percentile_ms(percent), truth) << percent;
    EXPECT_LE(histogram->percentile_ms(percent), truth + 0.02 + 1e-9) << percent;
  }
  EXPECT_EQ(histogram->count(), 5000u);
  EXPECT_EQ(histogram->largest_ms(), static_cast<double>(all.back()) * 1e-6);
}

TEST(LatencyHistogram, HasNoQuantileOfNothingAndOneOfTheVeryLong) {
  const auto histogram = std::make_unique<LatencyHistogram>();
  EXPECT_EQ(histogram->percentile_ms(50), 0);
  histogram->add(UINT64_MAX);
  EXPECT_EQ(histogram->percentile_ms(50), static_cast<double>(UINT64_MAX) * 1e-6);
  histogram->add(0);
  histogram->add(0);
  EXPECT_LE(histogram->percentile_ms(50), 0.02);
}

}  // namespace
}  // namespace figurine::samples::latency_histogram_test
