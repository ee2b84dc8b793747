// Random numbers as a function of (seed, stream, counter): no state to save, so a resumed run draws
// what an uninterrupted one draws.
//
// Based on: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014 (the finaliser
// of SplitMix64, applied to a Weyl sequence).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace figurine::train {

uint64_t random_bits(uint64_t seed, uint64_t stream, uint64_t counter);

// Uniform in [0,1), 24 bits.
float random_unit(uint64_t seed, uint64_t stream, uint64_t counter);

// The order in which training visits `count` items: every epoch a fresh permutation, drawn from
// (seed, epoch). item(i) depends on i alone; the permutation of the last epoch asked for is kept.
class ShuffledOrder {
 public:
  ShuffledOrder(uint64_t seed, size_t count);
  size_t item(uint64_t iteration);

 private:
  uint64_t seed_;
  uint64_t epoch_ = ~uint64_t{0};
  std::vector<size_t> permutation_;
};

}  // namespace figurine::train
