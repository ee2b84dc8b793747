// What the frames of a run cost: times per stage, work counts, and their summaries.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "figurine/renderer.h"

namespace figurine::samples {

struct Summary {
  double median = 0;
  double p90 = 0, p99 = 0;  // nearest rank
};
// Zeros without values.
Summary summarise(std::vector<double> values);

class FrameLog {
 public:
  void add(const FrameStatistics& statistics, uint64_t total_ns);
  size_t frames() const { return total_ms_.size(); }
  Summary total_ms() const { return summarise(total_ms_); }
  // Frames that took longer than a screen of 60 Hz waits.
  uint64_t missed_60hz() const;
  // Of some stages together, summed within each frame.
  Summary stages_ms(std::span<const Stage> stages) const;

  // {"total": {"median": ms, "p90": ms, "p99": ms}, "maps": {...}, ...}, in the order of the
  // stages.
  nlohmann::ordered_json stages_json() const;
  // Medians of Gaussians, visible, pairs, blends and macs; means of runs of networks and of those
  // that were left out.
  nlohmann::ordered_json work_json() const;

 private:
  std::vector<double> total_ms_;
  std::vector<double> stage_ms_[kStageCount];
  std::vector<double> gaussians_, visible_, pairs_, blends_, macs_;
  uint64_t networks_ = 0, unchanged_networks_ = 0, stale_networks_ = 0, coarse_avatars_ = 0,
           averted_texels_ = 0, pulled_poses_ = 0;
};

}  // namespace figurine::samples
