#include "toolchain/generation/convex_blend.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "figurine/check.h"

namespace figurine::generation {

using measure::RowMatrix;
using measure::RowVector;

namespace {

constexpr double kRounding =
    1e-12;  // of the largest squared norm: scalar products in double leave about 1e-15

// The point of least norm in the affine hull of some points: weights of sum 1, of either sign.
Eigen::VectorXd affine_weights(const Eigen::MatrixXd& gram,
                               const std::vector<Eigen::Index>& points) {
  // (G + s 1 1^T) u = 1 and w = u / sum u: adding the same to all products changes neither the
  // minimum nor, for s > 0, its conditioning.
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXd system(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) system(i, j) = gram(points[size_t(i)], points[size_t(j)]);
  }
  system.array() += system.diagonal().maxCoeff();
  const Eigen::VectorXd u = system.ldlt().solve(Eigen::VectorXd::Ones(n));
  return u / u.sum();
}

std::vector<size_t> in_order(const Eigen::VectorXd& values, bool ascending) {
  std::vector<size_t> order(static_cast<size_t>(values.size()));
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const double left = values[Eigen::Index(a)], right = values[Eigen::Index(b)];
    return ascending ? left < right : left > right;
  });
  return order;
}

}  // namespace

Eigen::VectorXd least_norm_weights(const Eigen::MatrixXd& gram) {
  const Eigen::Index n = gram.rows();
  const double rounding = kRounding * gram.diagonal().maxCoeff();
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(n);
  Eigen::Index first = 0;
  gram.diagonal().minCoeff(&first);
  weights[first] = 1;
  std::vector<Eigen::Index> corral{
      first};  // points in use: the current one is the least of their affine hull
  // Every round ends at a smaller norm, so no corral comes twice and the rounds are finite; in
  // rounding, the limit ends what cycles.
  for (Eigen::Index round = 0; round < 10 * n; ++round) {
    const Eigen::VectorXd products = gram * weights;
    Eigen::Index next = 0;
    const double least = products.minCoeff(&next);
    const bool in_use = std::find(corral.begin(), corral.end(), next) != corral.end();
    if (in_use || least >= weights.dot(products) - rounding) break;
    corral.push_back(next);
    for (;;) {
      const Eigen::VectorXd wanted = affine_weights(gram, corral);
      double step =
          1;  // from the current weights towards the wanted ones, as far as none turns negative
      for (size_t i = 0; i < corral.size(); ++i) {
        const double now = weights[corral[i]], then = wanted[Eigen::Index(i)];
        if (then < 0) step = std::min(step, now / (now - then));
      }
      for (size_t i = 0; i < corral.size(); ++i) {
        double& weight = weights[corral[i]];
        weight = std::max(0.0, weight + step * (wanted[Eigen::Index(i)] - weight));
        if (wanted[Eigen::Index(i)] < 0 && weight <= kRounding) weight = 0;
      }
      if (step == 1) break;
      std::erase_if(corral, [&](Eigen::Index point) { return weights[point] == 0; });
    }
  }
  return weights / weights.sum();
}

BlendSearch::BlendSearch(const RowMatrix& training)
    : training_(&training), mean_(training.colwise().mean()) {
  FIG_CHECK(training.rows() >= 2, "at least two members");
  centred_ = training.rowwise() - mean_;
  gram_ = centred_ * centred_.transpose();
}

Blend BlendSearch::blend_of(const RowVector& z, const Eigen::MatrixXd& gram,
                            const std::vector<size_t>& members) const {
  const auto n = static_cast<Eigen::Index>(members.size());
  Eigen::MatrixXd of_members(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j)
      of_members(i, j) = gram(Eigen::Index(members[size_t(i)]), Eigen::Index(members[size_t(j)]));
  }
  const Eigen::VectorXd weights = least_norm_weights(of_members);
  Blend blend;
  RowVector residual = z;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (weights[i] == 0) continue;
    blend.members.push_back(members[size_t(i)]);
    blend.weights.push_back(weights[i]);
    residual -= weights[i] * training_->row(Eigen::Index(members[size_t(i)]));
  }
  const double left = residual.norm(), whole = (z - mean_).norm();
  blend.relative_residual = left == 0 ? 0 : left / whole;
  return blend;
}

Blends BlendSearch::closest(const RowVector& z, size_t most) const {
  FIG_CHECK(most >= 1 && z.size() == mean_.size(),
            "a vector of the members' size, and at least one member");
  // Products of the differences z_n - z.
  const RowVector centred = z - mean_;
  const Eigen::VectorXd against = centred_ * centred.transpose();
  Eigen::MatrixXd gram = gram_.array() + centred.squaredNorm();
  gram.colwise() -= against;
  gram.rowwise() -= against.transpose();

  const std::vector<size_t> nearest = in_order(gram.diagonal(), true);
  Blends blends{{}, blend_of(z, gram, nearest)};
  Eigen::VectorXd hull = Eigen::VectorXd::Zero(gram.rows());
  for (size_t i = 0; i < blends.of_any.members.size(); ++i)
    hull[Eigen::Index(blends.of_any.members[i])] = blends.of_any.weights[i];
  const std::vector<size_t> heaviest = in_order(hull, false);
  for (size_t k = 1; k <= std::min(most, nearest.size()); ++k) {
    const auto first_k = [&](const std::vector<size_t>& order) {
      return std::vector<size_t>(order.begin(), order.begin() + std::ptrdiff_t(k));
    };
    Blend best = blend_of(z, gram, first_k(nearest));
    Blend other = blend_of(z, gram, first_k(heaviest));
    if (other.relative_residual < best.relative_residual) best = std::move(other);
    if (k > 1 && blends.of_few.back().relative_residual < best.relative_residual)
      best = blends.of_few.back();
    blends.of_few.push_back(std::move(best));
  }
  return blends;
}

}  // namespace figurine::generation
