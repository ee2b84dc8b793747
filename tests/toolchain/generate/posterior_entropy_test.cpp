// Where members are decided: nothing at pure noise, all at no noise, and the band between by D x
// SNR, whatever D is.
#include "toolchain/verify/posterior_entropy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "figurine/detail/noise_level.h"
#include "tests/toolchain/generate/normal_rows.h"

namespace figurine::verify::posterior_entropy_test {
namespace {

std::vector<NoiseLevel> levels_at(size_t dimension, std::initializer_list<double> dimension_snr) {
  std::vector<NoiseLevel> levels;
  for (const double value : dimension_snr)
    levels.push_back(noise_level(0.5 * std::log(value / static_cast<double>(dimension))));
  return levels;
}

TEST(PosteriorEntropy, FallsFromLnNToNothingInTheBand) {
  constexpr Eigen::Index kMembers = 50;
  for (const Eigen::Index dimension : {200, 4000}) {
    const generate::RowMatrix members = tests::normal_rows(kMembers, dimension, 1u << 20);
    std::vector<NoiseLevel> levels =
        levels_at(static_cast<size_t>(dimension), {0.1, 1, 4, 8, 16, 100});
    levels.insert(levels.begin(), noise_level(-INFINITY)), levels.push_back(noise_level(INFINITY));
    const std::vector<double> entropy = posterior_entropy(members, levels);
    for (size_t l = 0; l < entropy.size(); ++l)
      std::printf("  %lld values, lambda %.2f: %.4f nats\n", static_cast<long long>(dimension),
                  levels[l].lambda, entropy[l]);
    const double all = std::log(static_cast<double>(kMembers));
    EXPECT_NEAR(entropy.front(), all, 1e-9);
    EXPECT_GT(entropy[1], 0.97 * all) << "D x SNR 0.1, where sampling begins";
    for (size_t l = 1; l < entropy.size(); ++l) EXPECT_LE(entropy[l], entropy[l - 1]) << l;
    // Members 2 D apart in square decide by log-odds of D x SNR: at 8, twice ln 50, most is
    // decided.
    EXPECT_LT(entropy[4], 0.5 * all);
    EXPECT_LT(entropy[6], 1e-6);
    EXPECT_EQ(entropy.back(), 0);
  }
}

TEST(PosteriorEntropy, IsTheSameForTheSameSeed) {
  const generate::RowMatrix members = tests::normal_rows(5, 64, 2);
  const std::vector<NoiseLevel> levels = levels_at(64, {2});
  EXPECT_EQ(posterior_entropy(members, levels), posterior_entropy(members, levels));
  EXPECT_NE(posterior_entropy(members, levels), posterior_entropy(members, levels, {.seed = 1000}));
  EXPECT_EQ(posterior_entropy(members.topRows(1), levels).front(), 0)
      << "a single member is always decided";
}

}  // namespace
}  // namespace figurine::verify::posterior_entropy_test
