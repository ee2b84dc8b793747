#include "runtime/src/sample/noise.h"

#include <cmath>

#include "figurine/double_math.h"

namespace figurine {

namespace {

struct Words {
  uint32_t high, low;
};

Words multiply(uint32_t a, uint32_t b) {
  const uint64_t product = static_cast<uint64_t>(a) * b;
  return {static_cast<uint32_t>(product >> 32), static_cast<uint32_t>(product)};
}

Words split(uint64_t value) { return {static_cast<uint32_t>(value >> 32), static_cast<uint32_t>(value)}; }

// The middle of a word's cell, exact in double.
double uniform(uint32_t word) { return (static_cast<double>(word) + 0.5) * 0x1p-32; }

}  // namespace

std::array<uint32_t, 4> philox4x32_10(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key) {
  constexpr uint32_t kMultiplier0 = 0xD2511F53, kMultiplier1 = 0xCD9E8D57;
  constexpr uint32_t kWeyl0 = 0x9E3779B9, kWeyl1 = 0xBB67AE85;  // the golden ratio and sqrt(3) - 1
  for (int round = 0; round < 10; ++round) {
    const Words a = multiply(kMultiplier0, counter[0]), b = multiply(kMultiplier1, counter[2]);
    counter = {b.high ^ counter[1] ^ key[0], b.low, a.high ^ counter[3] ^ key[1], a.low};
    key[0] += kWeyl0;
    key[1] += kWeyl1;
  }
  return counter;
}

std::array<double, 2> box_muller(uint32_t radius_word, uint32_t angle_word) {
  const double radius = std::sqrt(-2.0 * log_double(uniform(radius_word)));
  const SineCosine angle = sine_cosine_of_turns(uniform(angle_word));
  return {radius * angle.cosine, radius * angle.sine};
}

void fill_normal(uint64_t seed, uint64_t stream, std::span<float> values, uint64_t first) {
  const Words key = split(seed), high = split(stream);
  for (size_t i = 0; i < values.size();) {
    const uint64_t index = first + i;
    const Words block = split(index / 4);
    const std::array<uint32_t, 4> words = philox4x32_10({block.low, block.high, high.low, high.high}, {key.low, key.high});
    const std::array<double, 2> a = box_muller(words[0], words[1]), b = box_muller(words[2], words[3]);
    const std::array<double, 4> normal = {a[0], a[1], b[0], b[1]};
    for (size_t k = index % 4; k < 4 && i < values.size(); ++k) values[i++] = static_cast<float>(normal[k]);
  }
}

}  // namespace figurine
