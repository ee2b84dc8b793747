// SplitMix64, where numbers are drawn one after the other: a counter through a bijective mixer, in
// integers alone, so the same on every machine. Initial weights and the shapes of MakeHuman people
// come from it: what it yields is pinned by a test and never changes.
//
// Based on: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014.
#pragma once

#include <cstdint>

namespace figurine::random {

// The golden ratio in 64 bits: the step of the counter.
inline constexpr uint64_t kWeylStep = 0x9e3779b97f4a7c15u;

// SplitMix64's finaliser: a bijection of 64 bits in which every bit of x decides about every bit.
constexpr uint64_t mix_bits(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

class SplitMix {
 public:
  explicit SplitMix(uint64_t state) : state_(state) {}

  uint64_t bits() { return mix_bits(state_ += kWeylStep); }
  // Uniform in [0,1), 53 bits.
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * unit(); }
  // Uniform in [-1,1), a multiple of 2^-23: exact in float.
  float signed_unit() {
    return static_cast<float>(static_cast<int64_t>(bits() >> 40) - (int64_t{1} << 23)) * 0x1p-23f;
  }
  // Sum of 12 uniforms: close to normal, within +-6, and free of libm.
  double nearly_normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += unit();
    return sum;
  }

 private:
  uint64_t state_;
};

}  // namespace figurine::random
