#include "figurine/detail/noise_level.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/detail/double_math.h"

namespace figurine {

namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_ratio(double x) { return x >= 1e-300 && x <= 1e300; }

double lambda_of_snr(double value) { return 0.5 * log_double(value); }
}  // namespace

NoiseLevel noise_level(double lambda) {
  // The smaller of alpha and sigma is the larger times e^-|lambda|: no overflow, and no difference
  // of nearly equal numbers.
  const double ratio = exp_double(lambda < 0 ? lambda : -lambda);
  const double larger = 1.0 / std::sqrt(1.0 + ratio * ratio), smaller = ratio * larger;
  return lambda < 0 ? NoiseLevel{lambda, smaller, larger} : NoiseLevel{lambda, larger, smaller};
}

double snr(const NoiseLevel& level) { return exp_double(2 * level.lambda); }

Result<NoiseSchedule> NoiseSchedule::create(const NoiseScheduleOptions& options) {
  if (options.dimension < 1)
    return Status(StatusCode::kInvalidArgument, "noise schedule: dimension is 0");
  for (const double value :
       {options.noisy_dimension_snr, options.decided_dimension_snr, options.clean_snr}) {
    if (!is_ratio(value))
      return Status(StatusCode::kInvalidArgument,
                    "noise schedule: a signal-to-noise ratio is not a positive number");
  }
  if (!(options.band_share >= 0 && options.band_share < 1)) {
    return Status(StatusCode::kInvalidArgument, "noise schedule: band_share is not in [0,1)");
  }
  const double dimension = static_cast<double>(options.dimension);
  NoiseSchedule schedule;
  schedule.noisy_ = lambda_of_snr(options.noisy_dimension_snr / dimension);
  schedule.clean_ = lambda_of_snr(options.clean_snr);
  schedule.band_ =
      std::min(lambda_of_snr(options.decided_dimension_snr / dimension), schedule.clean_);
  if (!(schedule.noisy_ < schedule.band_)) {
    return Status(
        StatusCode::kInvalidArgument,
        "noise schedule: the noisy end is not noisier than the end of the band and the clean end");
  }
  schedule.share_ = std::max(
      options.band_share, (schedule.band_ - schedule.noisy_) / (schedule.clean_ - schedule.noisy_));
  return schedule;
}

double NoiseSchedule::lambda(double u) const {
  FIG_CHECK(u >= 0 && u <= 1, "u is a place on the schedule, within [0,1]");
  if (u <= share_) return std::min(noisy_ + (band_ - noisy_) * (u / share_), band_);
  // From the clean end, which is then met exactly.
  return std::max(clean_ - (clean_ - band_) * ((1 - u) / (1 - share_)), band_);
}

void solver_levels(const NoiseSchedule& schedule, bool pure_noise_start,
                   std::span<NoiseLevel> levels) {
  FIG_CHECK(levels.size() >= 2, "a solver takes at least one step");
  const double steps = static_cast<double>(levels.size() - 1);
  for (size_t i = 0; i < levels.size(); ++i)
    levels[i] = schedule.level(static_cast<double>(i) / steps);
  if (pure_noise_start) levels.front() = noise_level(-kInfinity);
}

void linear_beta_levels(std::span<NoiseLevel> levels) {
  FIG_CHECK(levels.size() >= 2, "a solver takes at least one step");
  const size_t steps = levels.size() - 1;
  constexpr double kFirst = 1e-4, kLast = 2e-2;
  levels.back() = noise_level(kInfinity);
  // alpha^2 as the product of the kept parts, and sigma^2 as the sum of the added ones, so that
  // neither is a difference.
  double kept = 1, added = 0;
  for (size_t t = 0; t < steps; ++t) {
    const double beta =
        kFirst + (kLast - kFirst) *
                     (steps > 1 ? static_cast<double>(t) / static_cast<double>(steps - 1) : 0.0);
    added += kept * beta;
    kept *= 1 - beta;
    levels[steps - 1 - t] = {0.5 * log_double(kept / added), std::sqrt(kept), std::sqrt(added)};
  }
}

}  // namespace figurine
