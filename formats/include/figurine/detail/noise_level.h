// How noisy the weights of a new avatar are at each moment of its sampling: what a trainer of
// denoisers and the device's solver must mean alike (docs/numerics.md, "Sampling").
//
// Variance preserving diffusion: z = alpha x0 + sigma eps with alpha^2 + sigma^2 = 1. Time is
// lambda = ln(alpha / sigma), half the logarithm of the signal-to-noise ratio SNR = (alpha /
// sigma)^2 (Kingma et al., Variational Diffusion Models, 2021; lambda as in Lu et al., DPM-Solver,
// 2022): continuous, so that grids may be as fine as one likes. All values are the same to the bit
// on every CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "figurine/status.h"

namespace figurine {

struct NoiseLevel {
  double lambda = 0;  // -inf: nothing but noise; inf: none
  double alpha = 0;
  double sigma = 0;
};

// alpha and sigma to a few last bits for every lambda, both infinities included. NaN for NaN.
NoiseLevel noise_level(double lambda);

double snr(const NoiseLevel& level);

struct NoiseScheduleOptions {
  uint64_t dimension = 0;  // D, values of z that vary; at least 1
  double noisy_dimension_snr =
      0.1;  // D x SNR at the noisy end: here z says nothing about which member it came from
  double decided_dimension_snr = 100;  // D x SNR where the band ends that a member is decided in
  double clean_snr = 1e4;              // at the clean end: 40 dB, about the rounding of int8
  double band_share = 0.5;             // of the levels within the band, at least
};

// A monotone map from u in [0,1] to lambda: 0 is the noisy end, 1 the clean one. Linear in the band
// and linear beyond it, or linear throughout where this leaves the band its share already. For
// training, u is drawn uniformly; a solver takes equal steps of it.
class NoiseSchedule {
 public:
  // kInvalidArgument if an option is not finite and positive, or the ends are in the wrong order.
  static Result<NoiseSchedule> create(const NoiseScheduleOptions& options);

  double lambda(double u) const;
  NoiseLevel level(double u) const { return noise_level(lambda(u)); }

 private:
  double noisy_ = 0, band_ = 0, clean_ = 0;  // lambda
  double share_ = 0;                         // u where the band ends
};

// Levels of a solver with K = levels.size() - 1 steps, from noise to clean: u = 0, 1/K, ..., 1.
// pure_noise_start puts lambda = -inf in the place of the noisy end, so that the start is exactly
// what the sampler draws.
void solver_levels(const NoiseSchedule& schedule, bool pure_noise_start,
                   std::span<NoiseLevel> levels);

// The schedule of HyperDiffusion (Erkoc et al. 2023, after Ho et al. 2020), to compare with: beta
// linear from 1e-4 to 2e-2 over T = levels.size() - 1 steps, from the noisiest level to no noise at
// all (lambda = inf). With T = 500 it begins at alpha^2 = 0.0064, not at noise.
void linear_beta_levels(std::span<NoiseLevel> levels);

}  // namespace figurine
