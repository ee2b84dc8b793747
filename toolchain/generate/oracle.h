// The best denoisers there are, in closed form and double: of the training members themselves and
// of a Gaussian. What a trained denoiser, a solver and every table of samples are held against
// (docs/numerics.md, "Sampling"). No LibTorch.
//
// Letters: N training members, D values of a member.
#pragma once

#include <Eigen/Dense>

#include "figurine/detail/noise_level.h"

namespace figurine::generate {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowVector = Eigen::RowVectorXd;

// What z says about which member it came from.
struct Posterior {
  Eigen::VectorXd weights;  // [N] sum to 1
  double entropy_nats = 0;  // ln N where nothing is decided, 0 where all is
};

// Denoiser of the N members, each as likely as the others: the perfect memoriser. E[x0 | z] is the
// mean of the members weighted by the softmax of -|z - alpha z_n|^2 / (2 sigma^2). Sound at every
// level, pure noise and no noise included. O(N D) a call.
class MemberOracle {
 public:
  // members: [N,D], N >= 1; borrowed, must outlive the oracle.
  explicit MemberOracle(const RowMatrix& members) : members_(&members) {}

  Posterior posterior(const RowVector& z, const NoiseLevel& level) const;  // z: [D]
  RowVector predict(const RowVector& z, const NoiseLevel& level) const;    // E[x0 | z]

 private:
  const RowMatrix* members_;
};

// Denoiser of a Gaussian of independent values, and what the probability-flow equation does with
// it.
class GaussianOracle {
 public:
  // mean, variance: [D]; variances may be 0.
  GaussianOracle(RowVector mean, RowVector variance)
      : mean_(std::move(mean)), variance_(std::move(variance)) {}

  RowVector predict(const RowVector& z, const NoiseLevel& level) const;
  // Where z at a level arrives at another one, exactly.
  RowVector flow(const RowVector& z, const NoiseLevel& from, const NoiseLevel& to) const;

 private:
  RowVector mean_, variance_;
};

}  // namespace figurine::generate
