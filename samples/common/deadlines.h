// Frames at a steady rate, as a screen or a camera takes them: each begins at a tick and is due by
// the next. One that ends later has missed its deadline; the ticks that passed meanwhile are
// dropped, never caught up with, so that one slow frame costs what it took and no queue.
//
// Knows no clock: its caller says when a frame began and ended, in nanoseconds of any start.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <vector>

namespace figurine::samples {

class Deadlines {
 public:
  // hz above 0. The first tick is one period after start_ns.
  Deadlines(double hz, uint64_t start_ns);

  // When the next frame is to begin, and when it is due.
  uint64_t tick_ns() const { return time_of(tick_); }
  uint64_t deadline_ns() const { return time_of(tick_ + 1); }
  // The frame of that tick began, no earlier than it, and has ended.
  void add(uint64_t began_ns, uint64_t ended_ns);

  double hz() const { return hz_; }
  uint64_t frames() const { return late_ms_.size(); }
  uint64_t missed() const { return missed_; }    // frames that ended after their deadline
  uint64_t dropped() const { return dropped_; }  // ticks without a frame

  // {"hz", "frames", "missed", "dropped", "latency_ms": from tick to end, "wait_ms": from tick to
  // begin, what waking up took}; the latter two as {"p50", "p99", "worst"}, nearest rank.
  nlohmann::ordered_json json() const;

 private:
  uint64_t time_of(uint64_t tick) const;

  double hz_;
  uint64_t start_ns_, tick_ = 1, missed_ = 0, dropped_ = 0;
  std::vector<double> latency_ms_, late_ms_;
};

}  // namespace figurine::samples
