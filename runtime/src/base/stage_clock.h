// Adds up where a frame's time goes, through the caller's clock; without one it costs nothing.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/frame.h"

namespace figurine {

class StageClock {
 public:
  explicit StageClock(uint64_t (*now_ns)()) : now_ns_(now_ns) {}

  uint64_t now() const { return now_ns_ == nullptr ? 0 : now_ns_(); }
  void add(Stage stage, uint64_t duration_ns) {
    stage_ns_[static_cast<size_t>(stage)] += duration_ns;
  }
  const std::array<uint64_t, kStageCount>& stage_ns() const { return stage_ns_; }

  // Times a scope.
  class Scope {
   public:
    Scope(StageClock& clock, Stage stage) : clock_(clock), stage_(stage), begin_ns_(clock.now()) {}
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;
    ~Scope() { clock_.add(stage_, clock_.now() - begin_ns_); }

   private:
    StageClock& clock_;
    Stage stage_;
    uint64_t begin_ns_;
  };

 private:
  uint64_t (*now_ns_)();
  std::array<uint64_t, kStageCount> stage_ns_{};
};

}  // namespace figurine
