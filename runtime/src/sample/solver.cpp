#include "runtime/src/sample/solver.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "figurine/detail/double_math.h"

namespace figurine {

namespace {

Status invalid(const std::string& what) {
  return Status(StatusCode::kInvalidArgument, "sampling: " + what);
}

Status check_levels(std::span<const NoiseLevel> levels) {
  if (levels.size() < 2 || levels.size() - 1 > kMaxSolverSteps)
    return invalid("the number of steps is not within 1 to 1000");
  for (size_t i = 0; i < levels.size(); ++i) {
    const NoiseLevel& level = levels[i];
    const bool rises = i == 0 ? level.lambda < INFINITY : level.lambda > levels[i - 1].lambda;
    const double power = level.alpha * level.alpha + level.sigma * level.sigma;
    const bool has_noise = level.sigma > 0 || i + 1 == levels.size();
    if (!rises || !has_noise || !(std::abs(power - 1) < 1e-6))
      return invalid("level " + std::to_string(i) + " is not one, or does not rise");
  }
  return {};
}

template <class Real>
bool all_finite(std::span<const Real> values) {
  Real sum = 0;  // of zeros and NaN: without a branch
  for (const Real value : values) sum += value - value;
  return sum == 0;
}

// One step: z' = keep z + take (x0 + extrapolate (x0 - previous x0)).
struct StepFactors {
  double keep = 0, take = 0, extrapolate = 0;
};

StepFactors step_factors(const NoiseLevel& from, const NoiseLevel& to) {
  // alpha_t - alpha_s sigma_t / sigma_s, without the difference: alpha_t (1 - e^-h). From pure
  // noise h is infinite, and so it is alpha_t.
  return {to.sigma / from.sigma, -to.alpha * expm1_double(from.lambda - to.lambda), 0};
}

// (1 / 2r) with r = h_previous / h, of DPM-Solver++(2M). Next to an infinite step there is nothing
// to extrapolate with.
double extrapolation(const NoiseLevel& before, const NoiseLevel& from, const NoiseLevel& to) {
  const double previous_h = from.lambda - before.lambda, h = to.lambda - from.lambda;
  return std::isinf(previous_h) || std::isinf(h) ? 0 : 0.5 * h / previous_h;
}

template <class Real>
void take_step(const StepFactors& factors, std::span<const Real> x0,
               std::span<const Real> previous_x0, std::span<Real> z) {
  const Real keep = static_cast<Real>(factors.keep), take = static_cast<Real>(factors.take);
  const Real extrapolate = static_cast<Real>(factors.extrapolate);
  if (extrapolate == 0) {  // previous_x0 may hold anything
    for (size_t i = 0; i < z.size(); ++i) z[i] = keep * z[i] + take * x0[i];
    return;
  }
  for (size_t i = 0; i < z.size(); ++i)
    z[i] = keep * z[i] + take * (x0[i] + extrapolate * (x0[i] - previous_x0[i]));
}

}  // namespace

template <class Real>
Status solve(const SolverOptions& options, std::span<const NoiseLevel> levels,
             Denoiser<Real>& denoiser, const SolverStorage<Real>& storage, std::span<Real> z,
             SolverTrace<Real>* trace) {
  FIG_CHECK(storage.x0.size() == z.size() && storage.previous_x0.size() == z.size(),
            "storage is as long as z");
  FIG_RETURN_IF_ERROR(check_levels(levels));
  if (!all_finite<Real>(z)) return invalid("the start is not finite");
  std::span<Real> x0 = storage.x0, previous_x0 = storage.previous_x0;
  const size_t steps = levels.size() - 1;
  for (size_t step = 0; step < steps; ++step) {
    const NoiseLevel &from = levels[step], &to = levels[step + 1];
    FIG_RETURN_IF_ERROR(denoiser.predict(z, from, step, x0));
    if (!all_finite<Real>(x0))
      return invalid("prediction " + std::to_string(step) + " is not finite");
    StepFactors factors = step_factors(from, to);
    const bool second_order = options.method == SolverMethod::kDpmSolverPlusPlus2M && step > 0;
    if (second_order && !(options.lower_order_final && step + 1 == steps))
      factors.extrapolate = extrapolation(levels[step - 1], from, to);
    take_step<Real>(factors, x0, previous_x0, z);
    if (!all_finite<Real>(z)) return invalid("step " + std::to_string(step) + " is not finite");
    if (trace != nullptr) trace->after_step(step, to, z, x0);
    std::swap(x0, previous_x0);
  }
  if (!options.final_x0) return {};
  FIG_RETURN_IF_ERROR(denoiser.predict(z, levels.back(), steps, x0));
  if (!all_finite<Real>(x0)) return invalid("the last prediction is not finite");
  std::copy(x0.begin(), x0.end(), z.begin());
  return {};
}

template Status solve<float>(const SolverOptions&, std::span<const NoiseLevel>, Denoiser<float>&,
                             const SolverStorage<float>&, std::span<float>, SolverTrace<float>*);
template Status solve<double>(const SolverOptions&, std::span<const NoiseLevel>, Denoiser<double>&,
                              const SolverStorage<double>&, std::span<double>,
                              SolverTrace<double>*);

}  // namespace figurine
