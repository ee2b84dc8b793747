// Thousands of deterministic mutations behind renewed checksums, in memory that ends where the
// package ends: whatever is still accepted keeps every promise of an opened package, whatever is
// refused gives a reason, and nothing else happens. The same mutations run under the sanitizers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>

#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "tests/emulated.h"

namespace figurine::package_mutation_test {
namespace {

using samples::GuardedBytes;
using samples::Seal;

using Bytes = std::vector<std::byte>;

// SplitMix64. Based on: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  uint64_t below(uint64_t bound) { return next() % bound; }
  uint64_t between(uint64_t first, uint64_t end) { return first + below(end - first); }

 private:
  uint64_t state_;
};

template <class T>
void put(Bytes& bytes, size_t at, T value) {
  if (at + sizeof(T) <= bytes.size()) std::memcpy(bytes.data() + at, &value, sizeof(T));
}

uint32_t interesting_u32(Random& random) {
  constexpr uint32_t kValues[] = {0,   1,    2,          3,          4,          255,
                                  256, 1024, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFC, 0xFFFFFFFF};
  return random.below(3) == 0 ? static_cast<uint32_t>(random.next())
                              : kValues[random.below(std::size(kValues))];
}

float interesting_f32(Random& random) {
  constexpr float kMax = std::numeric_limits<float>::max(),
                  kTiny = std::numeric_limits<float>::denorm_min();
  constexpr float kInfinity = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kValues[] = {0,     -0.0f, 1,     -1,        0.999f,     1e-6f, 1e6f,
                               kTiny, kMax,  -kMax, kInfinity, -kInfinity, kNan};
  return kValues[random.below(std::size(kValues))];
}

// One change to index, blob, extent, header or length.
void mutate(Bytes& bytes, const Seal& seal, Random& random) {
  // An earlier change may have put any number there.
  const uint64_t index_end = kPackageHeaderBytes + uint64_t{samples::get_header(bytes).index_bytes};
  const size_t end = std::clamp<uint64_t>(index_end, kPackageHeaderBytes + 1, bytes.size());
  switch (random.below(9)) {
    case 0:
      bytes[random.between(kPackageHeaderBytes, end)] ^=
          std::byte{static_cast<uint8_t>(1u << random.below(8))};
      break;
    case 1:
      bytes[random.between(kPackageHeaderBytes, end)] =
          std::byte{static_cast<uint8_t>(random.next())};
      break;
    case 2:
      put(bytes, random.between(kPackageHeaderBytes, end) / 4 * 4, interesting_u32(random));
      break;
    case 3:
      put(bytes, random.between(end - 1, bytes.size()) / 4 * 4, interesting_f32(random));
      break;
    case 4:
      put(bytes, random.between(end - 1, bytes.size()) / 4 * 4, interesting_u32(random));
      break;
    case 5:
      bytes[random.between(end - 1, bytes.size())] = std::byte{static_cast<uint8_t>(random.next())};
      break;
    case 6: {
      const size_t at = seal.extent_at(random.below(seal.blob_count())) + 8 * random.below(2);
      const uint64_t values[] = {0,
                                 64,
                                 bytes.size(),
                                 bytes.size() - 64,
                                 random.below(bytes.size()) / 64 * 64,
                                 random.next(),
                                 uint64_t{0} - 64};
      put(bytes, at, values[random.below(std::size(values))]);
      break;
    }
    case 7: {
      layout::Header header = samples::get_header(bytes);
      header.index_bytes = random.below(2) == 0 ? interesting_u32(random)
                                                : static_cast<uint32_t>(random.below(bytes.size()));
      samples::put_header(bytes, header);
      break;
    }
    case 8: {
      bytes.resize(
          std::max<size_t>(kPackageHeaderBytes + 64, random.below(bytes.size() + 256) / 64 * 64));
      layout::Header header = samples::get_header(bytes);
      header.file_bytes = bytes.size();
      samples::put_header(bytes, header);
      break;
    }
  }
}

class PackageMutation : public testing::TestWithParam<samples::SampleKind> {};

INSTANTIATE_TEST_SUITE_P(EachKind, PackageMutation, testing::ValuesIn(samples::kSampleKinds),
                         [](const auto& kind) { return samples::to_string(kind.param); });

TEST_P(PackageMutation, NeverBreaksAPromise) {
  const Result<Bytes> sound = write_sample(GetParam());
  ASSERT_TRUE(sound.ok()) << sound.status().message();
  const Seal seal(*sound);
  const GuardedBytes guarded(sound->size() + 4096);
  constexpr int kMutations = tests::kEmulated ? 2000 : 20000;
  std::map<std::string, int> outcomes;
  for (int i = 0; i < kMutations; ++i) {
    Random random(uint64_t(GetParam()) << 32 | uint64_t(i));
    Bytes bytes = *sound;
    for (uint64_t changes = 1 + random.below(3); changes > 0; --changes)
      mutate(bytes, seal, random);
    seal.renew(bytes);
    const std::span<std::byte> memory = guarded.bytes(bytes.size());
    std::memcpy(memory.data(), bytes.data(), bytes.size());
    const Result<Package> package = Package::open(memory, "mutant.fgn");
    if (package.ok()) {
      ++outcomes["accepted"];
      std::string reason;
      ASSERT_TRUE(samples::exercise(*package, reason)) << "mutation " << i << ": " << reason;
    } else {
      ++outcomes[to_string(package.status().code())];
      ASSERT_EQ(package.status().message().rfind("mutant.fgn: ", 0), 0u)
          << package.status().message();
      ASSERT_EQ(package.status().message().find('\n'), std::string::npos)
          << package.status().message();
    }
  }
  for (const auto& [outcome, count] : outcomes) std::printf("  %s: %d\n", outcome.c_str(), count);
  // Both sides of the reader's judgement were reached, or the mutations are blunt.
  EXPECT_GT(outcomes["accepted"], kMutations / 50);
  EXPECT_GT(outcomes["corrupt"], kMutations / 5);
}

}  // namespace
}  // namespace figurine::package_mutation_test
