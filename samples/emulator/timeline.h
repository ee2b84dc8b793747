// Where a motion is, as its viewer plays, pauses and scrubs it. Knows no clock: somebody says how
// much time went by.
#pragma once

#include <cstdint>

namespace figurine::emulator {

class Timeline {
 public:
  static constexpr double kSlowest = 0.1, kFastest = 4;

  // Of another motion: stays where it is, as far as there is such a time. At least one frame.
  void set_length(uint32_t frames, double frames_per_second);
  // Time of the motion, from 0; begins again at the end.
  void advance(double elapsed_s);
  // Clamped to the motion.
  void seek(double time_s);
  void set_playing(bool playing) { playing_ = playing; }
  void set_speed(double speed);  // times the motion's own, clamped

  bool playing() const { return playing_; }
  double speed() const { return speed_; }
  double time_s() const { return time_s_; }
  double duration_s() const { return frames_ / frames_per_second_; }
  double frames_per_second() const { return frames_per_second_; }
  uint32_t frames() const { return frames_; }
  uint32_t frame() const;  // the one that is nearest
  bool moves() const { return frames_ > 1; }

 private:
  uint32_t frames_ = 1;
  double frames_per_second_ = 30, time_s_ = 0, speed_ = 1;
  bool playing_ = true;
};

}  // namespace figurine::emulator
