// Under an emulator a test takes ten to fifty times as long. Where it looks at very many cases of
// code that is the same on every CPU, the host looks at all of them, and an emulated core at a
// share.
#pragma once

#include <cstddef>

namespace figurine::tests {

#ifdef FIGURINE_EMULATED  // by CMake, in a cross build
inline constexpr bool kEmulated = true;
#else
inline constexpr bool kEmulated = false;
#endif

// Every STRIDE-th of many cases; no power of two, so that no bit of a byte or word is left out.
inline constexpr size_t stride_of_many(size_t emulated) { return kEmulated ? emulated : 1; }

}  // namespace figurine::tests
