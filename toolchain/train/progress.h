// What training shows while it runs: one line that rewrites itself on a terminal, one plain line
// about every fifteen seconds elsewhere.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::train {

struct TrainingLine {
  uint64_t iteration = 0;
  double loss = 0;  // running means
  double psnr_db = 0;
  double iterations_per_second = 0;
  double seconds_left = 0;
};

std::string format_duration(double seconds);  // "4:07", "1:02:09"

class Progress {
 public:
  explicit Progress(std::string title, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // fraction: of the work, in [0,1]. Called as often as the caller likes; prints a few times a
  // second at most.
  void show(double fraction, const TrainingLine& line);
  void show(double fraction, const std::string& text);
  // A line of its own, above the bar.
  void say(const std::string& text);

 private:
  bool due() const;

  std::string title_;
  bool quiet_;
  bool terminal_;
  bool open_line_ = false;
  double last_shown_s_ = -1e9;
};

}  // namespace figurine::train
