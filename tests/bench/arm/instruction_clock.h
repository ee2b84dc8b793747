// A clock that counts what the program executes, for a program on an emulated core under
// counting_plugin (counters.h); of one thread.
//
// It is the profile clock, and takes clock_gettime's place: there an instruction is a microsecond.
#pragma once

#include <array>
#include <cstdint>

#include "bench/arm/counters.h"
#include "bench/profile_clock.h"

namespace figurine::bench {

// Of all counters since the core was started. Zeros without the plugin.
std::array<uint64_t, kCounters> read_counters();

// What read_clock() and clock_gettime() read from now on; at first instructions.
void choose_counter(Counter counter);

}  // namespace figurine::bench
