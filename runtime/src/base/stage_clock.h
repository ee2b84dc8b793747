// Adds up where a frame's time goes, through the caller's clock; without one it costs nothing.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/frame.h"

namespace figurine {

class StageClock {
 public:
  StageClock() = default;
  StageClock(uint64_t (*now_ns)(void* user), void* user) : now_ns_(now_ns), user_(user) {}

  uint64_t now() const { return now_ns_ == nullptr ? 0 : now_ns_(user_); }
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
  uint64_t (*now_ns_)(void* user) = nullptr;
  void* user_ = nullptr;
  std::array<uint64_t, kStageCount> stage_ns_{};
};

}  // namespace figurine
