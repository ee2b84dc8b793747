// Random choices: bounds, distribution, and that nothing depends on what else was drawn.
#include "toolchain/random/stream.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "figurine/detail/philox.h"

namespace figurine::random::stream_test {
namespace {

TEST(RandomStream, IntegersAreTheirWordsShareOfTheCount) {
  const RandomStream stream(7, RandomUse::kChosenMembers, 3);
  const uint64_t number = uint64_t{static_cast<uint32_t>(RandomUse::kChosenMembers)} << 32 | 3;
  for (uint64_t counter = 0; counter < 100; ++counter) {
    const auto words = stream_words(7, number, counter / 2);
    const uint64_t word = uint64_t{words[counter % 2 * 2]} << 32 | words[counter % 2 * 2 + 1];
    for (const uint64_t count : {1ull, 2ull, 5ull, 1000ull, 0xffffffffull}) {
      const auto wanted =
          static_cast<uint64_t>((static_cast<unsigned __int128>(word) * count) >> 64);
      ASSERT_EQ(stream.index(counter, count), wanted);
      ASSERT_LT(wanted, count);
    }
  }
}

TEST(RandomStream, IntegersAreUniform) {
  const RandomStream stream(1, RandomUse::kResampledSamples);
  constexpr size_t kDraws = 70'000, kCount = 7;
  std::vector<size_t> counts(kCount, 0);
  for (size_t i = 0; i < kDraws; ++i) ++counts[stream.index(i, kCount)];
  double chi2 = 0;
  for (const size_t count : counts)
    chi2 += (double(count) - 10'000) * (double(count) - 10'000) / 10'000;
  EXPECT_LT(chi2, 22.5) << "the 99.9th percentile of chi-squared with 6 degrees of freedom";
}

TEST(RandomStream, EverySetIsAsLikelyAsAnyOther) {
  std::map<std::set<size_t>, size_t> counts;
  constexpr uint32_t kDraws = 20'000;
  for (uint32_t item = 0; item < kDraws; ++item) {
    const std::vector<size_t> chosen =
        RandomStream(2, RandomUse::kAveragedMembers, item).distinct(3, 5);
    ++counts[{chosen.begin(), chosen.end()}];
  }
  ASSERT_EQ(counts.size(), 10u) << "five over three, and no member twice";
  double chi2 = 0;
  for (const auto& [set, count] : counts)
    chi2 += (double(count) - 2'000) * (double(count) - 2'000) / 2'000;
  EXPECT_LT(chi2, 27.9) << "the 99.9th percentile of chi-squared with 9 degrees of freedom";
}

TEST(RandomStream, AllOfThemAreAPermutation) {
  std::vector<size_t> chosen = RandomStream(3, RandomUse::kFeatureSubset).distinct(20, 20);
  std::sort(chosen.begin(), chosen.end());
  for (size_t i = 0; i < 20; ++i) EXPECT_EQ(chosen[i], i);
  EXPECT_TRUE(RandomStream(3, RandomUse::kFeatureSubset).distinct(0, 4).empty());
}

TEST(RandomStream, UsesItemsAndSeedsDiffer) {
  const auto first_values = [](uint64_t seed, RandomUse use, uint32_t item) {
    std::vector<double> values(6);
    RandomStream(seed, use, item).fill_normal(values);
    return values;
  };
  const std::vector<double> values = first_values(1, RandomUse::kGaussianValues, 5);
  EXPECT_EQ(first_values(1, RandomUse::kGaussianValues, 5), values);
  EXPECT_NE(first_values(2, RandomUse::kGaussianValues, 5), values);
  EXPECT_NE(first_values(1, RandomUse::kGaussianMixture, 5), values);
  EXPECT_NE(first_values(1, RandomUse::kGaussianValues, 6), values);
  std::vector<double> longer(9);
  RandomStream(1, RandomUse::kGaussianValues, 5).fill_normal(longer);
  EXPECT_TRUE(std::equal(values.begin(), values.end(), longer.begin()))
      << "a longer draw begins with the shorter one";
}

}  // namespace
}  // namespace figurine::random::stream_test
