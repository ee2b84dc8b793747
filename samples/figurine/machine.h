// What the machine says of itself and of this process: names, clocks, memory. Linux.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::samples {

uint64_t now_ns();             // monotonic
uint32_t usable_cpus();        // that this process may run on
std::string cpu_name();        // as the kernel prints it, or "unknown"
uint64_t peak_memory_bytes();  // largest resident size so far (VmHWM); 0 if unknown
std::string date_utc();        // "2026-01-31T12:00:00Z"

}  // namespace figurine::samples
