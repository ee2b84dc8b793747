// The order in which training visits its items: every epoch a fresh permutation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace figurine::random {

// Permutations are drawn from (seed, epoch). item(i) depends on i alone; the permutation of the
// last epoch asked for is kept.
class ShuffledOrder {
 public:
  ShuffledOrder(uint64_t seed, size_t count);  // count: at least 1 (FIG_CHECK)
  size_t item(uint64_t iteration);

 private:
  uint64_t seed_;
  uint64_t epoch_ = ~uint64_t{0};
  std::vector<size_t> permutation_;
};

}  // namespace figurine::random
