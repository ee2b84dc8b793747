// The profile clock of this machine: nanoseconds since it was started.
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "bench/profile_clock.h"

namespace figurine::bench {

// By the system call, because clock_gettime is the one below.
uint64_t read_clock(void*) {
  timespec time{};
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &time);
  return static_cast<uint64_t>(time.tv_sec) * 1'000'000'000 + static_cast<uint64_t>(time.tv_nsec);
}

}  // namespace figurine::bench

extern "C" int clock_gettime(clockid_t, timespec* time) noexcept {
  const uint64_t ns = figurine::bench::read_clock();
  time->tv_sec = static_cast<time_t>(ns / 1'000'000);
  time->tv_nsec = static_cast<long>(ns % 1'000'000 * 1000);
  return 0;
}
