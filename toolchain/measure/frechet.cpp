#include "toolchain/measure/frechet.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "toolchain/error.h"

namespace figurine::measure {

namespace {

// The symmetric root. An eigenvalue of 0 comes out as rounding of the largest one; its root would
// be 1e-8 of that one's.
Eigen::MatrixXd root(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const Eigen::VectorXd& values = solver.eigenvalues();
  const double largest = values[values.size() - 1];
  const double rounding =
      static_cast<double>(values.size()) * std::numeric_limits<double>::epsilon() * largest;
  const Eigen::VectorXd roots = (values.array() > rounding).select(values.array().max(0).sqrt(), 0);
  return solver.eigenvectors() * roots.asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

FeatureGaussian fit_gaussian(const RowMatrix& features) {
  if (features.rows() < 2 || features.cols() == 0)
    throw InputError("features: at least two items of at least one feature are needed");
  if (!features.allFinite()) throw InputError("features: a value is not finite");
  FeatureGaussian gaussian{features.colwise().mean(), {}};
  const RowMatrix centred = features.rowwise() - gaussian.mean;
  gaussian.covariance = centred.transpose() * centred / static_cast<double>(features.rows() - 1);
  return gaussian;
}

double frechet_distance(const FeatureGaussian& a, const FeatureGaussian& b) {
  if (a.mean.size() != b.mean.size())
    throw InputError("features: the two sets have different numbers of features");
  // tr (A B)^(1/2) is the sum of the roots of the eigenvalues of A^(1/2) B A^(1/2), which are the
  // singular values of A^(1/2) B^(1/2): taken as those, a rounding of 1e-16 stays one and does not
  // become 1e-8.
  const Eigen::MatrixXd product = root(a.covariance) * root(b.covariance);
  const double trace_of_root = Eigen::BDCSVD<Eigen::MatrixXd>(product).singularValues().sum();
  return std::max(0.0, (a.mean - b.mean).squaredNorm() + a.covariance.trace() +
                           b.covariance.trace() - 2 * trace_of_root);
}

double frechet_distance(const RowMatrix& a, const RowMatrix& b) {
  return frechet_distance(fit_gaussian(a), fit_gaussian(b));
}

}  // namespace figurine::measure
