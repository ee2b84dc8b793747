// How far a statistic of samples and references would move with other samples and references:
// percentile intervals by resampling both (Efron, Bootstrap Methods: Another Look at the Jackknife,
// 1979). Says nothing about other training runs or other populations.
//
// Nearest neighbours make statistics depend on how many *different* items there are, and a resample
// has about 63 % of them: the MMD of resamples lies above the estimate. `bias` says by how much,
// and `centred` takes it out (docs/numerics.md, "Generation", says how often either interval holds
// the truth).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace figurine::measure {

// Items that take part in a statistic, each as often as it is listed.
struct Items {
  std::vector<size_t> samples, references;
};
Items all_items(size_t samples, size_t references);

struct BootstrapOptions {
  size_t replicates = 1000;  // at least 1
  double confidence = 0.95;  // between 0 and 1
  bool centred = true;       // the interval of the replicates, moved by -bias
  uint64_t seed = 0;
};

struct BootstrapInterval {
  double estimate = 0;   // of all items, each once
  double low = 0;        // the replicates' quantiles at (1 - confidence) / 2 from both ends
  double high = 0;       //
  double bias = 0;       // mean of the replicates - estimate
  double deviation = 0;  // standard deviation of the replicates: the estimate's standard error
  size_t replicates = 0;
};

// Replicate i draws as many samples and references as there are, with repetition, from (seed, i)
// alone. Replicates that are not finite are left out, and `replicates` counts the rest; NaN where
// none is left. Throws InputError without items, or for options out of range.
BootstrapInterval bootstrap_interval(size_t samples, size_t references,
                                     const std::function<double(const Items&)>& statistic,
                                     const BootstrapOptions& options);

}  // namespace figurine::measure
