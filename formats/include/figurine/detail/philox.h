// Random words as a function of a counter, and normal values of them: the same to the bit on every
// CPU, in any order and in any cut.
//
// Philox4x32-10 turns a counter into four random words (Salmon, Moraes, Dror and Shaw, Parallel
// Random Numbers: As Easy as 1, 2, 3, 2011); Box and Muller (1958) turn two words into two normal
// values. Words are the middles of 2^32 equal cells of (0,1), so the largest value is sqrt(2 ln
// 2^33) = 6.77, and none is infinite.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "figurine/detail/double_math.h"

namespace figurine {

inline std::array<uint32_t, 4> philox4x32_10(std::array<uint32_t, 4> counter,
                                             std::array<uint32_t, 2> key) {
  constexpr uint32_t kMultiplier0 = 0xD2511F53, kMultiplier1 = 0xCD9E8D57;
  constexpr uint32_t kWeyl0 = 0x9E3779B9, kWeyl1 = 0xBB67AE85;  // the golden ratio and sqrt(3) - 1
  for (int round = 0; round < 10; ++round) {
    const uint64_t a = uint64_t{kMultiplier0} * counter[0], b = uint64_t{kMultiplier1} * counter[2];
    counter = {static_cast<uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<uint32_t>(b),
               static_cast<uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<uint32_t>(a)};
    key[0] += kWeyl0;
    key[1] += kWeyl1;
  }
  return counter;
}

// Words 4 block, ..., 4 block + 3 of a stream: the key is the seed, the counter (block, stream).
inline std::array<uint32_t, 4> stream_words(uint64_t seed, uint64_t stream, uint64_t block) {
  const auto low = [](uint64_t value) { return static_cast<uint32_t>(value); };
  const auto high = [](uint64_t value) { return static_cast<uint32_t>(value >> 32); };
  return philox4x32_10({low(block), high(block), low(stream), high(stream)},
                       {low(seed), high(seed)});
}

// The two normal values of two random words.
inline std::array<double, 2> box_muller(uint32_t radius_word, uint32_t angle_word) {
  const auto middle = [](uint32_t word) {
    return (static_cast<double>(word) + 0.5) * 0x1p-32;
  };  // of its cell, exact in double
  const double radius = std::sqrt(-2.0 * log_double(middle(radius_word)));
  const SineCosine angle = sine_cosine_of_turns(middle(angle_word));
  return {radius * angle.cosine, radius * angle.sine};
}

// Normal values 4 block, ..., 4 block + 3 of a stream, one for each of its words.
inline std::array<double, 4> stream_normals(uint64_t seed, uint64_t stream, uint64_t block) {
  const std::array<uint32_t, 4> words = stream_words(seed, stream, block);
  const std::array<double, 2> a = box_muller(words[0], words[1]),
                              b = box_muller(words[2], words[3]);
  return {a[0], a[1], b[0], b[1]};
}

}  // namespace figurine
