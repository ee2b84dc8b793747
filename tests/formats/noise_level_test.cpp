// Noise levels: alpha and sigma against long double, where the levels lie, and what the copied
// schedule ends at.
#include "figurine/detail/noise_level.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/largest_error.h"

namespace figurine::noise_level_test {
namespace {

const uint64_t kDimensions[] = {1, 64, 9'886, 156'000, 598'011};

NoiseSchedule schedule_of(uint64_t dimension) {
  return NoiseSchedule::create({.dimension = dimension}).value();
}

TEST(NoiseLevel, AlphaAndSigmaAreExactAtBothEnds) {
  LargestError error("alpha and sigma, relative");
  for (int i = -3500; i <= 3500; ++i) {
    const double lambda = i / 10.0;
    const NoiseLevel level = noise_level(lambda);
    const long double alpha = 1 / std::sqrt(1 + std::exp(-2 * static_cast<long double>(lambda)));
    const long double sigma = 1 / std::sqrt(1 + std::exp(2 * static_cast<long double>(lambda)));
    error.add(static_cast<double>((level.alpha - alpha) / alpha));
    error.add(static_cast<double>((level.sigma - sigma) / sigma));
  }
  EXPECT_LE(error.largest(), 1e-15);
  const NoiseLevel noise = noise_level(-INFINITY), clean = noise_level(INFINITY);
  EXPECT_EQ(noise.alpha, 0);
  EXPECT_EQ(noise.sigma, 1);
  EXPECT_EQ(clean.alpha, 1);
  EXPECT_EQ(clean.sigma, 0);
  EXPECT_TRUE(std::isnan(noise_level(NAN).alpha));
}

TEST(NoiseSchedule, EndsAreWhereTheyWereAskedFor) {
  for (const uint64_t dimension : kDimensions) {
    const NoiseSchedule schedule = schedule_of(dimension);
    const double noisy = snr(schedule.level(0)) * static_cast<double>(dimension),
                 clean = snr(schedule.level(1));
    std::printf("dimension %7llu: D x SNR %.17g at the noisy end, SNR %.17g at the clean end\n",
                static_cast<unsigned long long>(dimension), noisy, clean);
    EXPECT_LE(noisy, 0.1 * (1 + 1e-14));
    EXPECT_NEAR(noisy, 0.1, 1e-14);
    EXPECT_NEAR(clean, 1e4, 1e-9);
  }
}

TEST(NoiseSchedule, HalfOfTheLevelsAreInTheDecidingBand) {
  for (const uint64_t dimension : kDimensions) {
    const NoiseSchedule schedule = schedule_of(dimension);
    double least = 1;
    for (size_t steps = 1; steps <= 1000; ++steps) {
      std::vector<NoiseLevel> levels(steps + 1);
      solver_levels(schedule, false, levels);
      size_t inside = 0;
      for (const NoiseLevel& level : levels) {
        const double place = snr(level) * static_cast<double>(dimension);
        inside += place >= 0.1 * (1 - 1e-13) && place <= 100 * (1 + 1e-13);
      }
      least = std::min(least, static_cast<double>(inside) / static_cast<double>(levels.size()));
    }
    std::printf("dimension %7llu: at least %.1f %% of the levels of 1 to 1000 steps in the band\n",
                static_cast<unsigned long long>(dimension), 100 * least);
    EXPECT_GE(least, 0.5);
  }
}

TEST(NoiseSchedule, RisesStrictlyAndWithoutAJump) {
  for (const uint64_t dimension : kDimensions) {
    const NoiseSchedule schedule = schedule_of(dimension);
    double before = schedule.lambda(0), largest = 0;
    for (int i = 1; i <= 10'000; ++i) {
      const double lambda = schedule.lambda(i / 10'000.0);
      ASSERT_GT(lambda, before) << dimension << " at " << i;
      largest = std::max(largest, lambda - before);
      before = lambda;
    }
    EXPECT_LT(largest, 3e-3) << dimension;
  }
}

TEST(NoiseSchedule, PureNoiseTakesThePlaceOfTheNoisyEnd) {
  std::vector<NoiseLevel> levels(5), pure(5);
  solver_levels(schedule_of(64), false, levels);
  solver_levels(schedule_of(64), true, pure);
  EXPECT_EQ(pure[0].lambda, -INFINITY);
  EXPECT_EQ(pure[0].alpha, 0);
  for (size_t i = 1; i < 5; ++i) EXPECT_EQ(pure[i].lambda, levels[i].lambda);
}

TEST(NoiseSchedule, RefusesWhatIsNoSchedule) {
  for (const NoiseScheduleOptions& options : {NoiseScheduleOptions{.dimension = 0},
                                              {.dimension = 9, .noisy_dimension_snr = 0},
                                              {.dimension = 9, .noisy_dimension_snr = NAN},
                                              {.dimension = 9, .noisy_dimension_snr = 200},
                                              {.dimension = 9, .decided_dimension_snr = INFINITY},
                                              {.dimension = 9, .clean_snr = -1},
                                              {.dimension = 9, .clean_snr = 1e-3},
                                              {.dimension = 9, .band_share = 1},
                                              {.dimension = 9, .band_share = NAN}}) {
    const Result<NoiseSchedule> schedule = NoiseSchedule::create(options);
    ASSERT_FALSE(schedule.ok());
    EXPECT_EQ(schedule.status().code(), StatusCode::kInvalidArgument);
    EXPECT_FALSE(schedule.status().message().empty());
  }
}

TEST(LinearBeta, EndsFarFromNoise) {
  std::vector<NoiseLevel> levels(501);
  linear_beta_levels(levels);
  long double kept = 1;
  LargestError error("alpha of the linear beta schedule, relative");
  for (int t = 0; t < 500; ++t) {
    kept *= 1 - (1e-4L + (2e-2L - 1e-4L) * t / 499);
    const NoiseLevel& level = levels[size_t(499 - t)];
    error.add(static_cast<double>((level.alpha - std::sqrt(kept)) / std::sqrt(kept)));
    error.add(static_cast<double>((level.sigma - std::sqrt(1 - kept)) / std::sqrt(1 - kept)));
    EXPECT_NEAR(level.lambda, std::log(level.alpha / level.sigma), 1e-13);
  }
  EXPECT_LE(error.largest(), 1e-13);
  const double terminal = snr(levels[0]);
  std::printf("linear beta, 500 steps: alpha^2 %.4f, SNR %.4f (%.1f dB) at the noisiest level\n",
              levels[0].alpha * levels[0].alpha, terminal, 10 * std::log10(terminal));
  for (const uint64_t dimension : kDimensions) {
    size_t inside = 0;
    for (const NoiseLevel& level : levels) {
      const double place = snr(level) * static_cast<double>(dimension);
      inside += place >= 0.1 && place <= 100;
    }
    std::printf(
        "linear beta, 500 steps, dimension %7llu: D x SNR %.3g at the noisiest level, %.1f %% of "
        "the levels in the band\n",
        static_cast<unsigned long long>(dimension), terminal * static_cast<double>(dimension),
        100.0 * double(inside) / 501);
  }
  EXPECT_NEAR(levels[0].alpha * levels[0].alpha, 0.0064, 5e-5);
  EXPECT_EQ(levels.back().lambda, INFINITY);
}

TEST(NoiseSchedule, HasTheSameBitsOnEveryCpu) {
  const NoiseSchedule schedule = schedule_of(156'000);
  const NoiseLevel a = schedule.level(0.3), b = schedule.level(0.8);
  EXPECT_EQ(a.lambda, -0x1.43b287ad8398p+2);
  EXPECT_EQ(a.alpha, 0x1.a0c82a84abc4ep-8);
  EXPECT_EQ(a.sigma, 0x1.fffd597317aacp-1);
  EXPECT_EQ(b.lambda, 0x1.4ae8be768990ep+0);
  EXPECT_EQ(b.alpha, 0x1.edbac9fcc93b4p-1);
  EXPECT_EQ(b.sigma, 0x1.0f1beef5eff5ep-2);
}

}  // namespace
}  // namespace figurine::noise_level_test
