// A clock that counts what the program executes, for a program on an emulated core under
// counting_plugin (counters.h); of one thread.
//
// It takes clock_gettime's place too, so that libraries which time themselves count: there an
// instruction is a microsecond, because XNNPACK rounds down to those.
#pragma once

#include <array>
#include <cstdint>

#include "bench/arm/counters.h"

namespace figurine::bench {

// Of all counters since the core was started. Zeros without the plugin.
std::array<uint64_t, kCounters> read_counters();

// What read_clock() and clock_gettime() read from now on; at first instructions.
void choose_counter(Counter counter);
uint64_t read_clock(void* unused = nullptr);  // RendererOptions::now_ns

}  // namespace figurine::bench
