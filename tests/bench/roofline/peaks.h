// What this CPU can do at most of the operations that a frame is made of: loops that do nothing
// else, in registers, without a dependence that they wait for. One entry for each instruction set
// that this build has and this CPU runs.
#pragma once

#include <cstdint>
#include <vector>

namespace figurine::roofline {

// Repeats `rounds` times; returns how many operations that were, of all lanes. The sink keeps the
// compiler from leaving the work out.
using Loop = uint64_t (*)(uint64_t rounds, float* sink);

struct Peak {
  const char* isa = "";  // as --isa names it; of int8 the instructions: "avx512vnni", "sdot", ...
  Loop loop = nullptr;
};

// Products of int8 summed in int32, as XNNPACK's kernels of that instruction set do it: by 16-bit
// pairs where there is no dot product. The fastest last.
std::vector<Peak> int8_macs();
// Products of floats added: FMA where the instruction set has it.
std::vector<Peak> float_macs();
// The blend's exact tier: products, sums, minima and maxima in equal parts, never fused.
std::vector<Peak> blend_operations();

}  // namespace figurine::roofline
