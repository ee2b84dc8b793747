// Sampling at its ends: pure noise, few and large steps into a stiff end, next to no noise; in
// float, as on the device.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "runtime/src/sample/noise.h"
#include "runtime/src/sample/solver.h"
#include "tests/stability/rows.h"
#include "tests/stability/scene.h"

namespace figurine::stability {

#if FIGURINE_HAS_ORACLE
Rows posterior_at_extreme_levels();  // posterior_cases.cpp
#endif

namespace sampling {
namespace {

constexpr size_t kValues = 4096;
constexpr SolverMethod kMethods[] = {SolverMethod::kDdim, SolverMethod::kDpmSolverPlusPlus2M};

// The best denoiser of independent normal values.
class NormalDenoiser : public Denoiser<float> {
 public:
  NormalDenoiser(double mean, double deviation) : mean_(mean), variance_(deviation * deviation) {}
  Status predict(std::span<const float> z, const NoiseLevel& level, size_t,
                 std::span<float> x0) override {
    const double factor = level.alpha * variance_ /
                          (level.alpha * level.alpha * variance_ + level.sigma * level.sigma);
    for (size_t i = 0; i < z.size(); ++i)
      x0[i] = static_cast<float>(mean_ + factor * (z[i] - level.alpha * mean_));
    return {};
  }

 private:
  double mean_, variance_;
};

std::vector<NoiseLevel> levels_of(const NoiseScheduleOptions& options, size_t steps,
                                  bool pure_noise_start) {
  std::vector<NoiseLevel> levels(steps + 1);
  solver_levels(NoiseSchedule::create(options).value(), pure_noise_start, levels);
  return levels;
}

std::vector<float> noise() {
  std::vector<float> values(kValues);
  fill_normal(1, 0, values);
  return values;
}

// NaN where the run was refused.
std::vector<float> sampled(const SolverOptions& options, std::span<const NoiseLevel> levels,
                           Denoiser<float>& denoiser) {
  std::vector<float> z = noise(), x0(kValues, NAN), previous(kValues, NAN);
  if (!solve<float>(options, levels, denoiser, {x0, previous}, z).ok()) z.assign(kValues, NAN);
  return z;
}

Rows terminal_snr() {
  Rows rows;
  for (const uint64_t dimension : {1u, 9'886u, 156'000u, 598'011u}) {
    const double placed = snr(NoiseSchedule::create({.dimension = dimension}).value().level(0)) *
                          static_cast<double>(dimension);
    rows.push_back({"noisy end of the levels for " + std::to_string(dimension) + " values",
                    "D x SNR", Bound::kAtMost, 0.1 * (1 + 1e-12), placed});
  }
  std::vector<NoiseLevel> copied(501);
  linear_beta_levels(copied);
  rows.push_back({"noisy end of the linear beta schedule for 156000 values, to compare with",
                  "D x SNR", Bound::kAtLeast, 900, snr(copied[0]) * 156'000});
  return rows;
}

Rows few_steps_into_a_stiff_end() {
  Rows rows;
  for (const size_t steps : {1, 2, 3}) {
    size_t not_finite = 0;
    double largest = 0;
    for (const double deviation : {0.0, 1e-3, 1.0}) {
      for (const double clean_snr : {1e4, 1e12}) {
        for (const SolverMethod method : kMethods) {
          for (const bool pure_noise_start : {false, true}) {
            NormalDenoiser denoiser(1, deviation);
            const NoiseScheduleOptions options{.dimension = 156'000, .clean_snr = clean_snr};
            const std::vector<float> z =
                sampled({method}, levels_of(options, steps, pure_noise_start), denoiser);
            not_finite += count_not_finite(z);
            for (const float value : z)
              largest = std::max(largest, std::abs(static_cast<double>(value)));
          }
        }
      }
    }
    const std::string name = std::to_string(steps) + (steps == 1 ? " step" : " steps") +
                             " to SNR 1e4 and 1e12, deviations 0 to 1";
    rows.push_back({name, "values that are not finite", Bound::kAtMost, 0, double(not_finite)});
    rows.push_back({name, "largest value, of a mean of 1", Bound::kAtMost, 10, largest});
  }
  return rows;
}

Rows last_step_near_no_noise() {
  Rows rows;
  const std::vector<float> start = noise();
  for (const double clean_snr : {1e4, 1e8, 1e16, double(INFINITY)}) {
    std::vector<NoiseLevel> levels =
        levels_of({.dimension = 156'000, .clean_snr = std::min(clean_snr, 1e16)}, 50, false);
    if (std::isinf(clean_snr)) levels.back() = noise_level(INFINITY);
    NormalDenoiser denoiser(
        1, 0);  // the same x0 everywhere: every solver is exact, and what is left is rounding
    double largest = 0;
    for (const SolverMethod method : kMethods) {
      const std::vector<float> z = sampled({method}, levels, denoiser);
      for (size_t i = 0; i < kValues; ++i) {
        const double eps = (start[i] - levels.front().alpha) / levels.front().sigma;
        const double error = std::abs(z[i] - (levels.back().alpha + levels.back().sigma * eps));
        if (!(error <= largest)) largest = error;
      }
    }
    char name[64];
    std::snprintf(name, sizeof(name), "50 steps to SNR %g, one x0", clean_snr);
    rows.push_back({name, "largest error of a float", Bound::kAtMost, 1e-6, largest});
  }
  return rows;
}

Rows first_step_from_pure_noise() {
  const std::vector<float> start = noise();
  const NoiseLevel levels[] = {noise_level(-INFINITY), noise_level(-7)};
  NormalDenoiser denoiser(1, 2);
  double largest = 0;
  for (const SolverMethod method : kMethods) {
    const std::vector<float> z = sampled({method}, levels, denoiser);
    for (size_t i = 0; i < kValues; ++i) {
      const double error =
          std::abs(z[i] - (levels[1].alpha * 1 +
                           levels[1].sigma * start[i]));  // the mean is all that is known
      if (!(error <= largest)) largest = error;
    }
  }
  return {{"first step from pure noise", "largest difference from alpha x0 + sigma z",
           Bound::kAtMost, 1e-6, largest}};
}

constexpr Case kCases[] = {{"SamplingTerminalSnr", terminal_snr},
                           {"SamplingFewSteps", few_steps_into_a_stiff_end},
#if FIGURINE_HAS_ORACLE
                           {"SamplingPosterior", posterior_at_extreme_levels},
#endif
                           {"SamplingLastStep", last_step_near_no_noise},
                           {"SamplingPureNoise", first_step_from_pure_noise}};

}  // namespace
}  // namespace sampling

std::span<const Case> sampling_cases() { return sampling::kCases; }

}  // namespace figurine::stability
