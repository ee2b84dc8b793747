// What is counted of a program on an emulated ARM core: how the plugin in QEMU (counting_plugin)
// and the program (instruction_clock) call it, and how they meet.
//
// The program runs kReadHint, which every ARM core takes for a nop, and stores to the first of
// kCounters words: the plugin sees both and fills the words.
#pragma once

#include <cstddef>
#include <cstdint>

namespace figurine::bench {

// Each instruction is of one kind, so that kinds sum to kInstructions. Of vectors where it says so;
// scalar arithmetic of floats counts for kOtherVector too.
enum class Counter : uint8_t {
  kInstructions,
  kDotProduct,             // sdot, udot: 16 products of bytes
  kVectorMultiplyInteger,  // smull, smlal, mla, ...
  kFusedMultiplyAdd,       // fmla, fmls, fmadd, ...
  kOtherVector,
  kLoad,
  kStore,
  kBranch,
  kInteger,  // arithmetic of general registers
  kOther,    // what remains: barriers, hints, system registers
};
inline constexpr size_t kCounters = 10;
inline constexpr const char* kCounterNames[kCounters] = {"instructions",
                                                         "dot_product",
                                                         "vector_multiply_integer",
                                                         "fused_multiply_add",
                                                         "other_vector",
                                                         "load",
                                                         "store",
                                                         "branch",
                                                         "integer",
                                                         "other"};

inline constexpr uint32_t kReadHint = 42;

}  // namespace figurine::bench
