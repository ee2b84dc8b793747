#include "samples/emulator/timeline.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"

namespace figurine::emulator {

void Timeline::set_length(uint32_t frames, double frames_per_second) {
  FIG_CHECK(frames > 0 && frames_per_second > 0, "a motion has frames and a rate");
  frames_ = frames, frames_per_second_ = frames_per_second;
  seek(time_s_);
}

void Timeline::advance(double elapsed_s) {
  if (!playing_ || !moves()) return;
  time_s_ = std::fmod(time_s_ + std::max(elapsed_s, 0.0) * speed_, duration_s());
}

// The last frame has its own time: the end is that of the frame, where the next round begins.
void Timeline::seek(double time_s) {
  time_s_ = std::isfinite(time_s) ? std::clamp(time_s, 0.0, (frames_ - 1) / frames_per_second_) : 0;
}

void Timeline::set_speed(double speed) {
  speed_ = std::isfinite(speed) ? std::clamp(speed, kSlowest, kFastest) : 1;
}

uint32_t Timeline::frame() const {
  return static_cast<uint32_t>(std::llround(time_s_ * frames_per_second_)) % frames_;
}

}  // namespace figurine::emulator
