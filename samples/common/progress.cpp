#include "samples/common/progress.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace figurine::samples {

namespace {

volatile std::sig_atomic_t noted_signal = 0;

void note_signal(int signal) { noted_signal = signal; }

}  // namespace

Progress::Progress(std::string what, uint64_t total)
    : what_(std::move(what)), total_(total), terminal_(::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (shown_) std::fputs("\r\033[K", stderr);
}

void Progress::update(uint64_t done) {
  const Clock::time_point now = Clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  if (!terminal_ || elapsed_s < 1 || now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  shown_ = true;
  constexpr uint64_t kWidth = 30;
  const uint64_t filled = total_ == 0 ? 0 : std::min(kWidth, kWidth * done / total_);
  const double left_s = done == 0
                            ? 0
                            : elapsed_s * static_cast<double>(total_ - std::min(done, total_)) /
                                  static_cast<double>(done);
  std::fprintf(stderr, "\r%s [%s%s] %llu/%llu, %.1f/s, %.0f s left\033[K", what_.c_str(),
               std::string(filled, '#').c_str(), std::string(kWidth - filled, '.').c_str(),
               static_cast<unsigned long long>(done), static_cast<unsigned long long>(total_),
               static_cast<double>(done) / elapsed_s, left_s);
  std::fflush(stderr);
}

void catch_interrupts() {
  struct sigaction action{};
  action.sa_handler = note_signal;
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup{};
  ::sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) ::sigaction(SIGHUP, &action, nullptr);  // nohup stays
  std::signal(SIGPIPE, SIG_IGN);
}

Status check_interrupt() {
  return noted_signal == 0 ? Status()
                           : Status(StatusCode::kInterrupted, "interrupted; nothing was written");
}

void die_of_interrupt() {
  std::signal(noted_signal, SIG_DFL);
  std::raise(noted_signal);
  std::_Exit(128 + noted_signal);
}

}  // namespace figurine::samples
