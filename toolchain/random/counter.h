// Random numbers as a function of (seed, stream, counter): no state, so nothing depends on the
// order in which things are drawn, and a resumed run draws what an uninterrupted one draws.
//
// Two ways of mixing the three, because runs and captures that exist stand on each: CounterRandom
// makes captures, random_bits trains. Both are pinned by a test. New code takes random_bits; where
// statistics need exactly uniform integers or normal values, stream.h.
//
// Based on: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014 (split_mix.h).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "toolchain/random/split_mix.h"

namespace figurine::random {

// Each argument is mixed before the next is added: (seed 1, stream 2) shares nothing with (seed 2,
// stream 1).
constexpr uint64_t random_bits(uint64_t seed, uint64_t stream, uint64_t counter) {
  const uint64_t key = mix_bits(seed + kWeylStep) + (stream + 1) * kWeylStep;
  return mix_bits(mix_bits(key) + (counter + 1) * kWeylStep);
}

// Uniform in [0,1), 24 bits.
inline float random_unit(uint64_t seed, uint64_t stream, uint64_t counter) {
  return static_cast<float>(random_bits(seed, stream, counter) >> 40) * 0x1p-24f;
}

// Standard normal by Box and Muller, from 24 bits of this stream and of the next.
inline double random_normal(uint64_t seed, uint64_t stream, uint64_t counter) {
  return std::sqrt(-2 * std::log(1 - double{random_unit(seed, stream, counter)})) *
         std::cos(6.283185307179586 * double{random_unit(seed, stream + 1, counter)});
}

class CounterRandom {
 public:
  CounterRandom(uint64_t seed, uint64_t stream)
      : key_(mix_bits((mix_bits(seed + kWeylStep) ^ stream) + kWeylStep)) {}

  uint64_t bits(uint64_t counter) const {
    return mix_bits(key_ + counter * 0xd1342543de82ef95u + kWeylStep);
  }
  // Uniform in [0,1), 53 bits.
  double unit(uint64_t counter) const { return static_cast<double>(bits(counter) >> 11) * 0x1p-53; }
  double uniform(uint64_t counter, double low, double high) const {
    return low + (high - low) * unit(counter);
  }
  uint32_t index(uint64_t counter, size_t count) const {
    return static_cast<uint32_t>(unit(counter) * static_cast<double>(count));
  }
  // Standard normal by Box and Muller.
  double normal(uint64_t counter) const {
    return std::sqrt(-2 * std::log(1 - unit(2 * counter))) *
           std::cos(6.283185307179586 * unit(2 * counter + 1));
  }

 private:
  uint64_t key_;
};

}  // namespace figurine::random
