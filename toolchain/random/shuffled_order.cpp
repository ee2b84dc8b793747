#include "toolchain/random/shuffled_order.h"

#include <numeric>
#include <utility>

#include "figurine/check.h"
#include "toolchain/random/counter.h"

namespace figurine::random {

ShuffledOrder::ShuffledOrder(uint64_t seed, size_t count) : seed_(seed), permutation_(count) {
  FIG_CHECK(count > 0, "nothing to shuffle");
}

size_t ShuffledOrder::item(uint64_t iteration) {
  const uint64_t epoch = iteration / permutation_.size();
  if (epoch != epoch_) {
    std::iota(permutation_.begin(), permutation_.end(), size_t{0});
    for (size_t i = permutation_.size() - 1; i > 0; --i)
      std::swap(permutation_[i], permutation_[random_bits(seed_, epoch, i) % (i + 1)]);
    epoch_ = epoch;
  }
  return permutation_[iteration % permutation_.size()];
}

}  // namespace figurine::random
