#include "toolchain/generation/comparison_report.h"

#include <cmath>

#include "toolchain/json_number.h"
#include "toolchain/measure/statistics.h"

namespace figurine::generation {

using measure::bootstrap_interval;
using measure::BootstrapInterval;
using measure::BootstrapOptions;
using measure::disjoint_draws;
using measure::Items;
using measure::quantile;
using measure::SampleComparison;
using measure::SampleDistances;

nlohmann::json to_json(const BootstrapInterval& interval) {
  return {{"value", finite(interval.estimate)},
          {"low", finite(interval.low)},
          {"high", finite(interval.high)}};
}

nlohmann::json describe_draws(const SampleDistances& distances, DistanceUnit unit,
                              const BootstrapOptions& bootstrap) {
  const std::vector<SampleComparison> draws = disjoint_draws(distances);
  const SampleComparison& first = draws.front();
  const bool squared = unit == DistanceUnit::kSquaredError;
  nlohmann::json report{{"count", first.size()}}, means{{"count", draws.size()}};
  const auto add = [&](const char* name, const auto& statistic) {
    report[name] = to_json(bootstrap_interval(
        first.size(), first.size(), [&](const Items& items) { return statistic(first, items); },
        bootstrap));
    double sum = 0;
    for (const SampleComparison& draw : draws) sum += statistic(draw, draw.all());
    means[name] = finite(sum / static_cast<double>(draws.size()));
  };
  add(squared ? "mmd_psnr_db" : "mmd", [&](const SampleComparison& draw, const Items& items) {
    return squared ? draw.mmd_psnr_db(items) : draw.mmd(items);
  });
  add("coverage_percent", [](const SampleComparison& draw, const Items& items) {
    return draw.coverage_percent(items);
  });
  add("one_nna_percent",
      [](const SampleComparison& draw, const Items& items) { return draw.one_nna_percent(items); });
  report["one_nna_off_ideal"] =
      std::abs(report.at("one_nna_percent").at("value").get<double>() - 50);
  if (draws.size() > 1) report["draws"] = std::move(means);
  return report;
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

}  // namespace figurine::generation
