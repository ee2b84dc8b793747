// How many threads LibTorch works with.
#pragma once

#include <cstdint>

namespace figurine::model {

// For LibTorch's own loops, those that the calling thread begins, and for OpenBLAS, which
// multiplies everybody's float matrices on threads of its own and would take all cores: idle ones
// wait by spinning, and a training beside another one falls to a tenth of its speed
// (docs/generation.md).
void use_threads(uint32_t count);

// As many as usable CPUs, 16 at most.
uint32_t default_threads();

}  // namespace figurine::model
