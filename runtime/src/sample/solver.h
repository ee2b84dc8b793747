// From noise to the weights of a new avatar: deterministic solvers of the probability-flow equation
// with a denoiser that predicts x0.
//
// DDIM: Song, Meng and Ermon, Denoising Diffusion Implicit Models, 2021, eta = 0; the first order.
// DPM-Solver++(2M): Lu et al., DPM-Solver++, 2022, algorithm 2; the second order, from this
// prediction and the one before. The equations are in docs/numerics.md, "Sampling". No allocation,
// no randomness: the caller draws the start (noise.h), places the levels (noise_level.h)
// and lends the storage.
#pragma once

#include <cstdint>
#include <span>

#include "figurine/detail/noise_level.h"
#include "figurine/sampler.h"
#include "figurine/status.h"

namespace figurine {

struct SolverOptions {
  SolverMethod method = SolverMethod::kDpmSolverPlusPlus2M;
  // The last step of DPM-Solver++(2M) as one of the first order, against extrapolating in few and
  // large steps. Keeps the second order.
  bool lower_order_final = false;
  // Predicts once more at the clean end and returns that x0 in place of z.
  bool final_x0 = false;
};

// What the caller trained. Real is float or double.
template <class Real>
class Denoiser {
 public:
  virtual ~Denoiser() = default;
  // x0 [D] of z [D] at a level. evaluation: 0 for the first of a run. An error stops the run and is
  // returned as it is.
  virtual Status predict(std::span<const Real> z, const NoiseLevel& level, size_t evaluation,
                         std::span<Real> x0) = 0;
};

// Watches a run, e.g. to show its progress.
template <class Real>
class SolverTrace {
 public:
  virtual ~SolverTrace() = default;
  // After a step: z has arrived at the level, with the prediction that brought it there.
  virtual void after_step(size_t step, const NoiseLevel& level, std::span<const Real> z,
                          std::span<const Real> x0) = 0;
};

// What a run needs beside z. Both [D].
template <class Real>
struct SolverStorage {
  std::span<Real> x0, previous_x0;
};

// Takes z [D] from levels.front() to levels.back() in place; levels [K+1] with lambda rising, the
// first may be pure noise (-inf) and the last no noise (inf). One evaluation a step.
// kInvalidArgument for a K outside [1,1000], levels that do not rise, and values of z or of a
// prediction that are not finite; z is then of no use.
template <class Real>
Status solve(const SolverOptions& options, std::span<const NoiseLevel> levels,
             Denoiser<Real>& denoiser, const SolverStorage<Real>& storage, std::span<Real> z,
             SolverTrace<Real>* trace = nullptr);

}  // namespace figurine
