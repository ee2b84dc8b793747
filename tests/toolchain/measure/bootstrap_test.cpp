// Bootstrap intervals against the closed form for a mean, and how often they hold the truth for
// statistics of nearest neighbours.
#include "toolchain/measure/bootstrap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"
#include "toolchain/measure/sample_metrics.h"

namespace figurine::measure::bootstrap_test {
namespace {

TEST(Bootstrap, OfAMeanIsItsStandardError) {
  const RowMatrix values = tests::random_rows(200, 1, 1);
  const auto mean = [&](const Items& items) {
    double sum = 0;
    for (const size_t i : items.references) sum += values(Eigen::Index(i), 0);
    return sum / double(items.references.size());
  };
  const BootstrapInterval interval =
      bootstrap_interval(3, 200, mean, {.replicates = 20'000, .centred = false, .seed = 4});
  const double average = values.mean();
  const double error = std::sqrt((values.array() - average).square().mean() / 200);
  EXPECT_DOUBLE_EQ(interval.estimate, average);
  EXPECT_NEAR(interval.deviation / error, 1, 0.02);
  EXPECT_NEAR(interval.bias / error, 0, 0.03);
  EXPECT_NEAR((interval.low - average) / error, -1.96, 0.08);
  EXPECT_NEAR((interval.high - average) / error, 1.96, 0.08);
  EXPECT_EQ(interval.replicates, 20'000u);
  const BootstrapInterval narrow = bootstrap_interval(
      3, 200, mean, {.replicates = 20'000, .confidence = 0.5, .centred = false, .seed = 4});
  EXPECT_NEAR((narrow.high - average) / error, 0.674, 0.04);
}

TEST(Bootstrap, ResamplesBothSetsFromTheSeedAlone) {
  std::vector<Items> seen, again, other;
  const auto remember = [](std::vector<Items>& list) {
    return [&list](const Items& items) {
      list.push_back(items);
      return 0.0;
    };
  };
  bootstrap_interval(5, 7, remember(seen), {.replicates = 3, .seed = 1});
  bootstrap_interval(5, 7, remember(again), {.replicates = 2, .seed = 1});
  bootstrap_interval(5, 7, remember(other), {.replicates = 3, .seed = 2});
  ASSERT_EQ(seen.size(), 4u) << "three replicates and the estimate";
  for (const Items& items : seen) {
    ASSERT_EQ(items.samples.size(), 5u);
    ASSERT_EQ(items.references.size(), 7u);
    for (const size_t s : items.samples) EXPECT_LT(s, 5u);
    for (const size_t r : items.references) EXPECT_LT(r, 7u);
  }
  EXPECT_EQ(seen[0].samples, again[0].samples)
      << "replicate i does not depend on how many there are";
  EXPECT_EQ(seen[1].references, again[1].references);
  EXPECT_NE(seen[0].references, seen[1].references);
  EXPECT_NE(seen[0].references, other[0].references);
  std::vector<Items> alike;
  bootstrap_interval(7, 7, remember(alike), {.replicates = 1});
  EXPECT_NE(alike[0].samples, alike[0].references);
  EXPECT_EQ(seen[3].samples, (std::vector<size_t>{0, 1, 2, 3, 4}))
      << "the estimate: all items once";
}

TEST(Bootstrap, LeavesOutWhatIsNotFinite) {
  size_t calls = 0;
  const auto statistic = [&](const Items&) { return calls++ % 2 == 0 ? INFINITY : 3.0; };
  const BootstrapInterval interval = bootstrap_interval(2, 2, statistic, {.replicates = 11});
  EXPECT_EQ(interval.replicates, 5u);
  EXPECT_EQ(interval.estimate, 3);
  EXPECT_EQ(interval.low, 3);
  const BootstrapInterval nothing =
      bootstrap_interval(2, 2, [](const Items&) { return INFINITY; }, {.replicates = 5});
  EXPECT_EQ(nothing.replicates, 0u);
  EXPECT_TRUE(std::isnan(nothing.low));
}

TEST(Bootstrap, RefusesWhatItCannotResample) {
  const auto nothing = [](const Items&) { return 0.0; };
  EXPECT_THROW(bootstrap_interval(0, 3, nothing, {}), InputError);
  EXPECT_THROW(bootstrap_interval(3, 0, nothing, {}), InputError);
  EXPECT_THROW(bootstrap_interval(3, 3, nothing, {.replicates = 0}), InputError);
  EXPECT_THROW(bootstrap_interval(3, 3, nothing, {.confidence = 1}), InputError);
}

// How often intervals hold the mean over many pairs of sets.
struct Coverage {
  size_t plain = 0, centred = 0;
  double bias = 0, deviation = 0;  // means over the trials
};

TEST(Bootstrap, CentredIntervalsHoldWhatPlainOnesMiss) {
  constexpr size_t kItems = 20, kTrials = 200, kTruthTrials = 2000;
  // Samples a little narrower than references, in three dimensions.
  const auto comparison = [&](uint64_t trial) {
    const RowMatrix samples = 0.7 * tests::random_rows(kItems, 3, 2 * trial),
                    references = tests::random_rows(kItems, 3, 2 * trial + 1);
    return SampleComparison({rms_distances(samples, references, 1),
                             rms_distances(samples, samples, 1),
                             rms_distances(references, references, 1)});
  };
  using Statistic = double (SampleComparison::*)(const Items&) const;
  const Statistic statistics[] = {&SampleComparison::mmd, &SampleComparison::coverage_percent,
                                  &SampleComparison::one_nna_percent};
  const char* names[] = {"MMD", "COV", "1-NNA"};
  double truth[3] = {};
  Coverage coverage[3];
  for (uint64_t trial = 0; trial < kTruthTrials; ++trial) {
    const SampleComparison sets = comparison(1'000'000 + trial);
    for (int k = 0; k < 3; ++k) truth[k] += (sets.*statistics[k])(sets.all()) / kTruthTrials;
  }
  for (uint64_t trial = 0; trial < kTrials; ++trial) {
    const SampleComparison sets = comparison(trial);
    for (int k = 0; k < 3; ++k) {
      const auto statistic = [&](const Items& items) { return (sets.*statistics[k])(items); };
      const BootstrapInterval centred =
          bootstrap_interval(kItems, kItems, statistic, {.replicates = 200, .seed = trial});
      const double low = centred.low + centred.bias, high = centred.high + centred.bias;
      if (centred.low <= truth[k] && truth[k] <= centred.high) ++coverage[k].centred;
      if (low <= truth[k] && truth[k] <= high) ++coverage[k].plain;
      coverage[k].bias += centred.bias / kTrials;
      coverage[k].deviation += centred.deviation / kTrials;
    }
  }
  for (int k = 0; k < 3; ++k) {
    std::printf(
        "%s: mean %.4g, bias of the replicates %+.3g, their deviation %.3g; 95 %% intervals hold "
        "the mean in %.1f %% (plain), %.1f %% "
        "(centred)\n",
        names[k], truth[k], coverage[k].bias, coverage[k].deviation,
        100.0 * double(coverage[k].plain) / kTrials, 100.0 * double(coverage[k].centred) / kTrials);
    EXPECT_GE(double(coverage[k].centred) / kTrials, 0.9) << names[k];
  }
  EXPECT_GT(coverage[0].bias, 0.5 * coverage[0].deviation)
      << "fewer different samples are farther away";
  EXPECT_LT(coverage[0].plain, coverage[0].centred);
}

}  // namespace
}  // namespace figurine::measure::bootstrap_test
