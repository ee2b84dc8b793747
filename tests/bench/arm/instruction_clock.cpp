#include "bench/arm/instruction_clock.h"

#include <cstring>
#include <ctime>

namespace figurine::bench {
namespace {

// On one page of memory.
alignas(128) uint64_t words[kCounters];
Counter chosen = Counter::kInstructions;

// The plugin wants both instructions in one block: nothing may come between them, and the page of a
// function that is aligned does not end there.
[[gnu::noinline, gnu::aligned(64)]] void fill_words() {
  asm volatile("hint %0\n\tstr xzr, [%1]" : : "i"(kReadHint), "r"(words) : "memory");
}

}  // namespace

std::array<uint64_t, kCounters> read_counters() {
  fill_words();
  std::array<uint64_t, kCounters> counts;
  std::memcpy(counts.data(), words, sizeof(words));
  return counts;
}

void choose_counter(Counter counter) { chosen = counter; }

uint64_t read_clock(void*) {
  fill_words();
  return words[static_cast<size_t>(chosen)];
}

}  // namespace figurine::bench

extern "C" int clock_gettime(clockid_t, timespec* time) noexcept {
  const uint64_t count = figurine::bench::read_clock();
  time->tv_sec = static_cast<time_t>(count / 1000000);
  time->tv_nsec = static_cast<long>(count % 1000000 * 1000);
  return 0;
}
