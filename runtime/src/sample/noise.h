// Normal random numbers that are the same to the bit on every CPU, in any order and in any cut: value i depends on (seed, stream, i) alone.
//
// Philox4x32-10 turns a counter into four random words (Salmon, Moraes, Dror and Shaw, Parallel Random Numbers: As Easy as 1, 2, 3, 2011);
// Box and Muller (1958) turn two words into two normal values. Words are the middles of 2^32 equal cells of (0,1), so the largest value is
// sqrt(2 ln 2^33) = 6.77, and none is infinite.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace figurine {

std::array<uint32_t, 4> philox4x32_10(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key);

// The two normal values of two random words.
std::array<double, 2> box_muller(uint32_t radius_word, uint32_t angle_word);

// Values first, first + 1, ... of a stream. Allocates nothing; costs about a logarithm, a root, a sine and a cosine for every two values.
void fill_normal(uint64_t seed, uint64_t stream, std::span<float> values, uint64_t first = 0);

}  // namespace figurine
