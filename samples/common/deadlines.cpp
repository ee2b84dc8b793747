#include "samples/common/deadlines.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "figurine/check.h"

namespace figurine::samples {

namespace {

nlohmann::ordered_json percentiles(std::vector<double> values) {
  if (values.empty()) return nullptr;
  std::sort(values.begin(), values.end());
  const auto at_rank = [&](size_t percent) {
    const double value = values[(percent * values.size() + 99) / 100 - 1];
    return std::round(value * 1000) / 1000;
  };
  return {{"p50", at_rank(50)}, {"p99", at_rank(99)}, {"worst", at_rank(100)}};
}

double ms_between(uint64_t from_ns, uint64_t to_ns) {
  return static_cast<double>(to_ns - from_ns) * 1e-6;
}

}  // namespace

Deadlines::Deadlines(double hz, uint64_t start_ns) : hz_(hz), start_ns_(start_ns) {
  FIG_CHECK(hz > 0 && std::isfinite(hz), "a rate above 0");
}

// From the start, not from the tick before: a rounded period would drift.
uint64_t Deadlines::time_of(uint64_t tick) const {
  return start_ns_ + static_cast<uint64_t>(std::llround(static_cast<double>(tick) * 1e9 / hz_));
}

void Deadlines::add(uint64_t began_ns, uint64_t ended_ns) {
  FIG_CHECK(began_ns >= tick_ns() && ended_ns >= began_ns, "a frame that begins at its tick");
  late_ms_.push_back(ms_between(tick_ns(), began_ns));
  latency_ms_.push_back(ms_between(tick_ns(), ended_ns));
  missed_ += ended_ns > deadline_ns() ? 1 : 0;
  // On to the first tick that has not passed.
  ++tick_;
  if (ended_ns > tick_ns()) {
    const double ticks = std::floor(static_cast<double>(ended_ns - start_ns_) * hz_ * 1e-9);
    const uint64_t first = tick_;
    tick_ = std::max(tick_, static_cast<uint64_t>(ticks));
    while (tick_ns() < ended_ns) ++tick_;
    dropped_ += tick_ - first;
  }
}

nlohmann::ordered_json Deadlines::json() const {
  return {{"hz", hz_},
          {"frames", frames()},
          {"missed", missed_},
          {"dropped", dropped_},
          {"latency_ms", percentiles(latency_ms_)},
          {"wait_ms", percentiles(late_ms_)}};
}

}  // namespace figurine::samples
