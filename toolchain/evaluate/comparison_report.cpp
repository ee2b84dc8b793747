#include "toolchain/evaluate/comparison_report.h"

#include <cmath>

#include "toolchain/evaluate/statistics.h"

namespace figurine::evaluate {

nlohmann::json finite(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

nlohmann::json to_json(const BootstrapInterval& interval) {
  return {{"value", finite(interval.estimate)}, {"low", finite(interval.low)}, {"high", finite(interval.high)}};
}

nlohmann::json describe_nearest(const SampleComparison& comparison, const BootstrapOptions& bootstrap) {
  const auto interval = [&](const auto& statistic) {
    return bootstrap_interval(comparison.size(), comparison.size(), statistic, bootstrap);
  };
  const BootstrapInterval nna = interval([&](const Items& items) { return comparison.one_nna_percent(items); });
  return {{"coverage_percent", to_json(interval([&](const Items& items) { return comparison.coverage_percent(items); }))},
          {"one_nna_percent", to_json(nna)},
          {"one_nna_off_ideal", std::abs(nna.estimate - 50)}};
}

nlohmann::json describe(const Novelty& novelty) {
  std::vector<double> distances;
  for (const NearestMember& nearest : novelty.samples) distances.push_back(nearest.distance);
  return {{"median_nearest", quantile(distances, 0.5)},
          {"median_ratio", finite(novelty.median_ratio)},
          {"copy_distance", novelty.copy_distance},
          {"copy_share", novelty.copy_share},
          {"members_met", novelty.members_met}};
}

}  // namespace figurine::evaluate
