// Random choices of the statistics of samples: functions of (seed, what they are for, item,
// counter), so nothing depends on how much is drawn or in which order (figurine/detail/philox.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace figurine::random {

// What a stream is for: two uses of one seed share no words, nor do they with a sampler's noise,
// whose streams are small numbers.
enum class RandomUse : uint32_t {
  kResampledSamples = 1,
  kResampledReferences,
  kFeatureSubset,
  kGaussianValues,
  kGaussianMixture,
  kChosenMembers,
  kAveragedMembers,
  kNoisedMember,
  kMemberNoise,
};

// Counters of integers and of normal values stand for the same words: of one stream, draw one kind.
class RandomStream {
 public:
  RandomStream(uint64_t seed, RandomUse use, uint32_t item = 0)
      : seed_(seed), stream_(uint64_t{static_cast<uint32_t>(use)} << 32 | item) {}

  // Uniform in [0, count), 1 <= count < 2^32 (FIG_CHECK). A 64-bit word times count over 2^64, so
  // the probabilities differ by less than count / 2^64 of themselves.
  size_t index(uint64_t counter, size_t count) const;
  // m different ones of [0, count), m <= count (FIG_CHECK): every set is as likely as any other,
  // its order is not random. Costs m^2. Floyd's algorithm (Bentley and Floyd, A Sample of
  // Brilliance, 1987).
  std::vector<size_t> distinct(size_t m, size_t count) const;
  // Normal values 0, 1, ... of the stream.
  void fill_normal(std::span<double> values) const;

 private:
  uint64_t seed_, stream_;
};

}  // namespace figurine::random
