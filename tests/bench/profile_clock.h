// The clock that network_profile reads, one to a program: instructions on an emulated core
// (arm/instruction_clock), nanoseconds on this machine (wall_clock). Both take clock_gettime's
// place too and show a thousand times as much there, because XNNPACK, which times its operators by
// it, rounds down to microseconds.
#pragma once

#include <cstdint>

namespace figurine::bench {

uint64_t read_clock(void* unused = nullptr);  // RendererOptions::now_ns

}  // namespace figurine::bench
