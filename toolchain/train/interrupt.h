// Ctrl-C, and a terminal that goes away, as a flag: long work looks at it between steps, saves its
// state and throws Interrupted. A second Ctrl-C ends the process at once.
#pragma once

#include <stdexcept>

namespace figurine::train {

// Stopped by the user; what was done is saved. toolchain/cli turns it into exit code 130 (128 +
// SIGINT, as shells expect).
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Takes SIGINT, SIGTERM and, unless it is ignored (nohup), SIGHUP while it lives; the old handlers
// come back afterwards. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  bool requested() const;
  // For one of several ranks that stop together: SIGTERM is ignored from this object's end on,
  // until the process ends. All ranks get the signal, but not at one time, and one for which it
  // comes after another rank's has stopped and saved must still be able to say so.
  void ignore_late();

 private:
  bool ignore_late_ = false;
};

}  // namespace figurine::train
