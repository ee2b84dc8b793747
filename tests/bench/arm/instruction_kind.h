// Of which kind an AArch64 instruction is.
//
// Based on: Arm Architecture Reference Manual for A-profile, "A64 instruction set encoding".
#pragma once

#include <cstdint>

#include "bench/arm/counters.h"

namespace figurine::bench {

// word: the instruction as it lies in memory.
Counter kind_of(uint32_t word);

}  // namespace figurine::bench
