#include "bench/arm/instruction_kind.h"

namespace figurine::bench {
namespace {

// Whether the bits of mask are those of value.
constexpr bool is(uint32_t word, uint32_t mask, uint32_t value) { return (word & mask) == value; }

constexpr uint32_t bits(uint32_t word, uint32_t high, uint32_t low) {
  return (word >> low) & ((1u << (high - low + 1)) - 1);
}

bool is_load(uint32_t word) {
  if (is(word, 0x3B000000, 0x18000000)) return true;  // from a place relative to the program
  if (!is(word, 0x38000000, 0x38000000)) return bits(word, 22, 22) != 0;  // not of one register
  const uint32_t opcode = bits(word, 23, 22);
  const bool of_vector = bits(word, 26, 26) != 0;
  return of_vector ? (opcode & 1) != 0 : opcode != 0;
}

// Of vectors, and of floats in scalar registers.
Counter kind_of_vector(uint32_t word) {
  if (is(word, 0x9FE0FC00, 0x0E809400)) return Counter::kDotProduct;
  if (is(word, 0x9F000400, 0x0F000000)) {  // by one element of a vector
    switch (bits(word, 15, 12)) {
      case 0b0001:
      case 0b0101:
        return Counter::kFusedMultiplyAdd;
      case 0b1001:  // fmul
        return Counter::kOtherVector;
      case 0b1110:
        return Counter::kDotProduct;
      default:
        return Counter::kVectorMultiplyInteger;
    }
  }
  const bool fused = is(word, 0xBF20FC00, 0x0E20CC00) || is(word, 0xFF000000, 0x1F000000);
  if (fused) return Counter::kFusedMultiplyAdd;
  const bool widens = is(word, 0x9F208C00, 0x0E208000),
             keeps_width = is(word, 0x9F20F400, 0x0E209400) || is(word, 0x9F20FC00, 0x0E20B400);
  return widens || keeps_width ? Counter::kVectorMultiplyInteger : Counter::kOtherVector;
}

}  // namespace

Counter kind_of(uint32_t word) {
  // By bits 28 to 25, the manual's first table.
  const uint32_t group = bits(word, 28, 25);
  if ((group & 0b0101) == 0b0100) return is_load(word) ? Counter::kLoad : Counter::kStore;
  if ((group & 0b0111) == 0b0111) return kind_of_vector(word);
  if ((group & 0b0111) == 0b0101 || (group & 0b1110) == 0b1000) return Counter::kInteger;
  if ((group & 0b1110) == 0b1010)
    return is(word, 0xFF000000, 0xD5000000) ? Counter::kOther : Counter::kBranch;
  return Counter::kOther;
}

}  // namespace figurine::bench
