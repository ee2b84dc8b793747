#include "toolchain/measure/bootstrap.h"

#include <numeric>

#include "toolchain/error.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/random/stream.h"

namespace figurine::measure {

using random::RandomStream;
using random::RandomUse;

namespace {

std::vector<size_t> resampled(const RandomStream& stream, size_t count) {
  std::vector<size_t> items(count);
  for (size_t i = 0; i < count; ++i) items[i] = stream.index(i, count);
  return items;
}

}  // namespace

Items all_items(size_t samples, size_t references) {
  Items items{std::vector<size_t>(samples), std::vector<size_t>(references)};
  std::iota(items.samples.begin(), items.samples.end(), size_t{0});
  std::iota(items.references.begin(), items.references.end(), size_t{0});
  return items;
}

BootstrapInterval bootstrap_interval(size_t samples, size_t references,
                                     const std::function<double(const Items&)>& statistic,
                                     const BootstrapOptions& options) {
  if (samples == 0 || references == 0) throw InputError("bootstrap: no samples or no references");
  if (options.replicates == 0 || !(options.confidence > 0 && options.confidence < 1)) {
    throw InputError("bootstrap: at least one replicate, and a confidence between 0 and 1");
  }
  std::vector<double> values(options.replicates);
  for (size_t i = 0; i < values.size(); ++i) {
    const auto item = static_cast<uint32_t>(i);
    values[i] = statistic(
        {resampled(RandomStream(options.seed, RandomUse::kResampledSamples, item), samples),
         resampled(RandomStream(options.seed, RandomUse::kResampledReferences, item), references)});
  }
  const double estimate = statistic(all_items(samples, references));
  const Summary summary = summarise(values);
  const double bias = summary.mean - estimate, moved = options.centred ? bias : 0,
               tail = (1 - options.confidence) / 2;
  return {estimate, quantile(values, tail) - moved, quantile(values, 1 - tail) - moved,
          bias,     summary.standard_deviation,     summary.count};
}

}  // namespace figurine::measure
