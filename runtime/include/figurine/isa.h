// Instruction sets that kernels are written for. All of them give the same bits; they differ in
// time alone. The one exception is asked for (Approximation::fast_blend in frame.h).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace figurine {

// Of one architecture, from the smallest on: each runs what those before it run.
enum class Isa : uint8_t {
  kBaseline,  // what every CPU of the architecture has: SSE2 on x86-64, NEON on aarch64
  kNeon,      // aarch64
  kSse41,     // x86-64 from here on
  kAvx2,
  kAvx512,
};

const char* to_string(Isa isa);  // "baseline", "neon", "sse41", "avx2", "avx512"
std::optional<Isa> isa_from_string(std::string_view name);

// The instruction sets that this build has kernels for and this CPU runs, the baseline first. The
// last is the default wherever one can be chosen.
std::span<const Isa> supported_isas();

}  // namespace figurine
