// How many threads LibTorch works with, and how they wait.
#pragma once

#include <cstdint>

namespace figurine::train {

// For LibTorch's own loops and for OpenBLAS, which multiplies its float matrices on threads of its
// own and would take all cores: idle ones wait by spinning, and a training beside another one falls
// to a tenth of its speed (docs/generation.md).
void use_threads(uint32_t count);

// As many as usable CPUs, 16 at most.
uint32_t default_threads();

// OpenMP's threads, LibTorch's among them, wait by spinning for milliseconds at every barrier,
// which the thread that is waited for may need (docs/decisions/0024-threads.md). libgomp takes
// another length from the environment alone, when it is loaded: sets that and starts the program
// anew, once, unless the environment says how to wait already. First in main().
void wait_without_spinning(char** arguments);

}  // namespace figurine::train
