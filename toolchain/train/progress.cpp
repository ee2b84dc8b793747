#include "toolchain/train/progress.h"

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>

namespace figurine::train {

namespace {

constexpr double kTerminalPeriod_s = 0.2;
constexpr double kPlainPeriod_s = 15;
constexpr int kBarCells = 20;

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::string format_duration(double seconds) {
  const auto whole = static_cast<long>(std::lround(std::fmax(0.0, seconds)));
  char text[32];
  if (whole >= 3600) {
    std::snprintf(text, sizeof(text), "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(text, sizeof(text), "%ld:%02ld", whole / 60, whole % 60);
  }
  return text;
}

Progress::Progress(std::string title, bool quiet)
    : title_(std::move(title)), quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {
  if (!terminal_) last_shown_s_ = now_s();  // the first plain line comes after one period
}

Progress::~Progress() {
  if (open_line_) std::fputc('\n', stderr);
}

bool Progress::due() const {
  return !quiet_ && now_s() - last_shown_s_ >= (terminal_ ? kTerminalPeriod_s : kPlainPeriod_s);
}

void Progress::show(double fraction, const TrainingLine& line) {
  if (!due()) return;
  char text[256];
  std::snprintf(text, sizeof(text), "%llu  loss %.4f  PSNR %.2f dB  %.1f it/s  %s left",
                static_cast<unsigned long long>(line.iteration), line.loss, line.psnr_db,
                line.iterations_per_second, format_duration(line.seconds_left).c_str());
  show(fraction, std::string(text));
}

void Progress::show(double fraction, const std::string& text) {
  if (!due()) return;
  last_shown_s_ = now_s();
  if (!terminal_) {
    std::fprintf(stderr, "%s: %3.0f %%  %s\n", title_.c_str(), 100 * fraction, text.c_str());
    return;
  }
  std::string bar(kBarCells, '.');
  for (int i = 0; i < kBarCells && i < fraction * kBarCells; ++i) bar[static_cast<size_t>(i)] = '#';
  std::fprintf(stderr, "\r%s [%s] %3.0f %%  %s\x1b[K", title_.c_str(), bar.c_str(), 100 * fraction,
               text.c_str());
  std::fflush(stderr);
  open_line_ = true;
}

void Progress::say(const std::string& text) {
  if (quiet_) return;
  std::fprintf(stderr, "%s%s: %s\n", open_line_ ? "\r\x1b[K" : "", title_.c_str(), text.c_str());
  open_line_ = false;
}

}  // namespace figurine::train
