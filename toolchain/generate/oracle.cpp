#include "toolchain/generate/oracle.h"

#include <cmath>

namespace figurine::generate {

Posterior MemberOracle::posterior(const RowVector& z, const NoiseLevel& level) const {
  const RowMatrix& members = *members_;
  // Of the squares of differences, not of products: near the clean end the distances are small and
  // the products are not.
  Eigen::VectorXd distance2(members.rows());
  for (Eigen::Index n = 0; n < members.rows(); ++n)
    distance2[n] = (z - level.alpha * members.row(n)).squaredNorm();
  const double nearest2 = distance2.minCoeff();
  // Relative to the nearest member, whose weight is 1, so that the sum cannot vanish. sigma^2 may
  // be 0.
  Posterior posterior{Eigen::VectorXd(members.rows()), 0};
  double sum = 0, weighted = 0;
  for (Eigen::Index n = 0; n < members.rows(); ++n) {
    const double further = distance2[n] - nearest2;
    const double nats = further == 0 ? 0 : further / level.sigma / level.sigma / 2;
    const double weight = std::exp(-nats);
    posterior.weights[n] = weight;
    sum += weight;
    if (weight > 0) weighted += weight * nats;
  }
  posterior.weights /= sum;
  posterior.entropy_nats = std::log(sum) + weighted / sum;
  return posterior;
}

RowVector MemberOracle::predict(const RowVector& z, const NoiseLevel& level) const {
  return posterior(z, level).weights.transpose() * *members_;
}

RowVector GaussianOracle::predict(const RowVector& z, const NoiseLevel& level) const {
  const double alpha = level.alpha, noise = level.sigma * level.sigma;
  RowVector x0 = mean_;
  for (Eigen::Index d = 0; d < x0.size(); ++d) {
    const double total = alpha * alpha * variance_[d] + noise;
    if (total > 0) x0[d] += alpha * variance_[d] / total * (z[d] - alpha * mean_[d]);
  }
  return x0;
}

RowVector GaussianOracle::flow(const RowVector& z, const NoiseLevel& from,
                               const NoiseLevel& to) const {
  const auto deviation = [&](const NoiseLevel& level, Eigen::Index d) {
    return std::sqrt(level.alpha * level.alpha * variance_[d] + level.sigma * level.sigma);
  };
  RowVector arrived(z.size());
  for (Eigen::Index d = 0; d < z.size(); ++d) {
    arrived[d] = to.alpha * mean_[d] +
                 deviation(to, d) / deviation(from, d) * (z[d] - from.alpha * mean_[d]);
  }
  return arrived;
}

}  // namespace figurine::generate
