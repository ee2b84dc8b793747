#include "toolchain/train/random.h"

#include <numeric>
#include <utility>

#include "figurine/check.h"

namespace figurine::train {

namespace {

uint64_t mix(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

constexpr uint64_t kWeyl = 0x9e3779b97f4a7c15u;

}  // namespace

uint64_t random_bits(uint64_t seed, uint64_t stream, uint64_t counter) {
  // Each argument is mixed before the next is added: (seed 1, stream 2) shares nothing with (seed
  // 2, stream 1).
  return mix(mix(mix(seed + kWeyl) + (stream + 1) * kWeyl) + (counter + 1) * kWeyl);
}

float random_unit(uint64_t seed, uint64_t stream, uint64_t counter) {
  return static_cast<float>(random_bits(seed, stream, counter) >> 40) * 0x1p-24f;
}

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

}  // namespace figurine::train
