// Random choices as a function of (seed, stream, counter): no state, so nothing depends on the
// order in which things are drawn.
//
// Based on: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014 (the finaliser
// of SplitMix64 over a Weyl sequence).
#pragma once

#include <cmath>
#include <cstdint>

namespace figurine::capture {

inline uint64_t mix_bits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

class Random {
 public:
  Random(uint64_t seed, uint64_t stream) : key_(mix_bits(mix_bits(seed) ^ stream)) {}

  uint64_t bits(uint64_t counter) const { return mix_bits(key_ + counter * 0xd1342543de82ef95ull); }
  double unit(uint64_t counter) const {
    return static_cast<double>(bits(counter) >> 11) * 0x1p-53;
  }  // [0,1)
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

}  // namespace figurine::capture
