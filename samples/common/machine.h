// What the machine says of itself and of this process: names, CPUs, memory. Linux.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::samples {

std::string cpu_name();        // as the kernel prints it, or "unknown"
uint64_t peak_memory_bytes();  // largest resident size so far (VmHWM); 0 if unknown

}  // namespace figurine::samples
