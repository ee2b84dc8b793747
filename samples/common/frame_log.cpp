#include "samples/common/frame_log.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace figurine::samples {

namespace {

constexpr double kNsPerMs = 1e6;

// Microseconds are what a clock on a busy machine can honestly say.
double rounded(double ms) { return std::round(ms * 1000) / 1000; }

}  // namespace

Summary summarise(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  const auto at_rank = [&](size_t percent) { return values[(percent * n + 99) / 100 - 1]; };
  return {median, at_rank(90), at_rank(99)};
}

void FrameLog::add(const FrameStatistics& statistics, uint64_t total_ns) {
  total_ms_.push_back(static_cast<double>(total_ns) / kNsPerMs);
  for (size_t s = 0; s < kStageCount; ++s)
    stage_ms_[s].push_back(static_cast<double>(statistics.stage_ns[s]) / kNsPerMs);
  gaussians_.push_back(static_cast<double>(statistics.gaussians));
  visible_.push_back(static_cast<double>(statistics.visible));
  pairs_.push_back(static_cast<double>(statistics.pairs));
  blends_.push_back(static_cast<double>(statistics.blends));
  macs_.push_back(static_cast<double>(statistics.macs));
  networks_ += statistics.networks;
  unchanged_networks_ += statistics.left_out.unchanged_networks;
  stale_networks_ += statistics.stale_networks;
  coarse_avatars_ += statistics.coarse_avatars;
  averted_texels_ += statistics.averted_texels;
  pulled_poses_ += statistics.pulled_poses;
}

uint64_t FrameLog::missed_60hz() const {
  return static_cast<uint64_t>(std::count_if(total_ms_.begin(), total_ms_.end(),
                                             [](double ms) { return ms > 1000.0 / 60; }));
}

Summary FrameLog::stages_ms(std::span<const Stage> stages) const {
  std::vector<double> sums(frames(), 0);
  for (const Stage stage : stages) {
    const std::vector<double>& values = stage_ms_[static_cast<size_t>(stage)];
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += values[i];
  }
  return summarise(std::move(sums));
}

nlohmann::ordered_json FrameLog::stages_json() const {
  const auto entry = [](const Summary& summary) {
    return nlohmann::ordered_json{{"median", rounded(summary.median)},
                                  {"p90", rounded(summary.p90)},
                                  {"p99", rounded(summary.p99)}};
  };
  nlohmann::ordered_json json = {{"total", entry(total_ms())}};
  for (size_t s = 0; s < kStageCount; ++s)
    json[to_string(static_cast<Stage>(s))] = entry(summarise(stage_ms_[s]));
  return json;
}

nlohmann::ordered_json FrameLog::work_json() const {
  const auto count = [](const std::vector<double>& values) {
    return static_cast<uint64_t>(std::llround(summarise(values).median));
  };
  const auto per_frame = [&](uint64_t sum) {
    return static_cast<double>(sum) / static_cast<double>(std::max<size_t>(frames(), 1));
  };
  return {{"gaussians", count(gaussians_)},
          {"visible", count(visible_)},
          {"pairs", count(pairs_)},
          {"blends", count(blends_)},
          {"macs", count(macs_)},
          {"networks", per_frame(networks_)},
          {"unchanged_networks", per_frame(unchanged_networks_)},
          {"stale_networks", per_frame(stale_networks_)},
          {"coarse_avatars", per_frame(coarse_avatars_)},
          {"averted_texels", per_frame(averted_texels_)},
          {"pulled_poses", per_frame(pulled_poses_)}};
}

}  // namespace figurine::samples
