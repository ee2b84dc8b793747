// A progress bar on the terminal, and the user's interrupt.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "figurine/status.h"

namespace figurine::samples {

// Shown on stderr after the first second, at most ten times a second, and wiped at the end. Says
// nothing when stderr is no terminal.
class Progress {
 public:
  Progress(std::string what, uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void update(uint64_t done);

 private:
  using Clock = std::chrono::steady_clock;
  std::string what_;
  uint64_t total_;
  bool terminal_;
  bool shown_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_{};
};

// From here on SIGINT, SIGTERM and, unless it is ignored (nohup), SIGHUP are only noted; long loops
// ask for the note and leave with kInterrupted, so that destructors remove what is half done.
// SIGPIPE is ignored: a reader that goes away is an error of write().
void catch_interrupts();
Status check_interrupt();
// Ends the process the way the noted signal would have, so that shells and scripts see the truth.
[[noreturn]] void die_of_interrupt();

}  // namespace figurine::samples
