// Distances of feature sets against closed forms, brute-force loops and constants that were worked
// out elsewhere.
#include "toolchain/measure/frechet.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/largest_error.h"
#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"
#include "toolchain/measure/kernel_distance.h"

namespace figurine::measure::frechet_test {
namespace {

using tests::random_rows;

// The two sets of the constants: 12 and 10 items of 3 features, in fractions.
RowMatrix twelve() {
  RowMatrix a(12, 3);
  for (int i = 0; i < 12; ++i) {
    for (int j = 0; j < 3; ++j) a(i, j) = (3 * i + 5 * j + i * j * j) % 13 / 13.0;
  }
  return a;
}
RowMatrix ten() {
  RowMatrix b(10, 3);
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 3; ++j) b(i, j) = (7 * i + 2 * j * j + 3 * i * j) % 11 / 11.0 - 0.25;
  }
  return b;
}

Eigen::MatrixXd rotation(Eigen::Index size, uint64_t seed) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(Eigen::MatrixXd(random_rows(size, size, seed)))
      .householderQ();
}

TEST(FrechetDistance, IsWhatExactArithmeticFinds) {
  // Means and covariances in Python fractions, the root of C_a C_b by Denman and Beavers' iteration
  // in 80 decimal digits (its square is off by 6e-82); the kernel distance in fractions throughout:
  // 3181476795096020197/14185060615921029120.
  EXPECT_NEAR(frechet_distance(twelve(), ten()), 0.20766511539060919758532109418, 1e-14);
  EXPECT_NEAR(kernel_distance(twelve(), ten()), 0.22428362354160080891406667588, 1e-14);
}

TEST(FrechetDistance, OfIndependentFeaturesIsThatOfTheirDeviations) {
  FeatureGaussian a{RowVector(3), {}}, b{RowVector(3), {}};
  a.mean << 1, 2, 3;
  b.mean << 1, 0, 4;
  a.covariance = Eigen::Vector3d(4, 9, 0).asDiagonal();
  b.covariance = Eigen::Vector3d(1, 0, 0.25).asDiagonal();
  // |mean difference|^2 + sum (sd_a - sd_b)^2
  EXPECT_NEAR(frechet_distance(a, b), 5 + 1 + 9 + 0.25, 1e-13);
}

TEST(FrechetDistance, OfCommutingCovariancesIsThatOfTheirEigenvalues) {
  const Eigen::MatrixXd q = rotation(20, 1);
  Eigen::VectorXd left = random_rows(20, 1, 2).array().square().matrix(),
                  right = random_rows(20, 1, 3).array().square().matrix();
  left.head(10)
      .setZero();  // roots of rounding there would count against what b has in those directions
  const RowVector zero = RowVector::Zero(20);
  const FeatureGaussian a{zero, q * left.asDiagonal() * q.transpose()},
      b{zero, q * right.asDiagonal() * q.transpose()};
  EXPECT_NEAR(frechet_distance(a, b), (left.cwiseSqrt() - right.cwiseSqrt()).squaredNorm(), 1e-13);
}

TEST(FrechetDistance, OfTwoFeaturesHasARootInClosedForm) {
  // tr (C)^(1/2) = sqrt(tr C + 2 sqrt(det C)) for 2 x 2 with eigenvalues that are not negative.
  LargestError error("Frechet distance of two features");
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const FeatureGaussian a = fit_gaussian(random_rows(9, 2, 100 + seed)),
                          b = fit_gaussian(3 * random_rows(7, 2, 200 + seed));
    const Eigen::Matrix2d product = a.covariance * b.covariance;
    const double trace_of_root = std::sqrt(product.trace() + 2 * std::sqrt(product.determinant()));
    error.add(frechet_distance(a, b), (a.mean - b.mean).squaredNorm() + a.covariance.trace() +
                                          b.covariance.trace() - 2 * trace_of_root);
  }
  EXPECT_LE(error.largest(), 1e-12);
}

TEST(FrechetDistance, OfASetToItselfIsNothingEvenIfItIsSingular) {
  const RowMatrix flat =
      random_rows(10, 4, 4) * random_rows(4, 64, 5);  // 10 items, 64 features, rank 4
  const double scale = fit_gaussian(flat).covariance.trace();
  const double itself = frechet_distance(flat, flat) / scale;
  std::printf("distance of a singular set to itself: %.3g of its variance\n", itself);
  EXPECT_GE(itself, 0);
  EXPECT_LE(itself, 1e-13);
  const RowMatrix moved = flat.array() + 0.5;
  EXPECT_NEAR(frechet_distance(flat, moved), 64 * 0.25, 1e-12 * scale);
  EXPECT_EQ(frechet_distance(RowMatrix::Ones(3, 2), RowMatrix::Ones(4, 2)), 0)
      << "no variance at all";
}

TEST(FrechetDistance, DoesNotDependOnOrderOrRotation) {
  const RowMatrix a = random_rows(30, 6, 6) * random_rows(6, 6, 7), b = random_rows(25, 6, 8);
  const double distance = frechet_distance(a, b);
  EXPECT_NEAR(frechet_distance(b, a), distance, 1e-12);
  EXPECT_NEAR(frechet_distance(a.colwise().reverse(), b), distance, 1e-12);
  const Eigen::MatrixXd q = rotation(6, 9);
  EXPECT_NEAR(frechet_distance(a * q, b * q), distance, 1e-12);
}

TEST(FrechetDistance, FallsWithTheNumberOfItems) {
  // Sets of one distribution are 0 apart; the estimate is not, and the less the more items there
  // are.
  const double few = frechet_distance(random_rows(70, 64, 10), random_rows(70, 64, 11));
  const double many = frechet_distance(random_rows(7000, 64, 12), random_rows(7000, 64, 13));
  std::printf("64 features of one distribution: %.3g with 70 items, %.3g with 7,000\n", few, many);
  EXPECT_GT(few, 10);
  EXPECT_LT(many, 0.5);
}

TEST(KernelDistance, EqualsBruteForce) {
  const RowMatrix a = random_rows(11, 5, 20), b = random_rows(8, 5, 21).array() + 0.3;
  const auto mean_kernel = [](const RowMatrix& x, const RowMatrix& y, bool different) {
    long double sum = 0;
    int pairs = 0;
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      for (Eigen::Index j = 0; j < y.rows(); ++j) {
        if (different && i == j) continue;
        long double product = 0;
        for (Eigen::Index f = 0; f < x.cols(); ++f) product += (long double)x(i, f) * y(j, f);
        const long double base = product / x.cols() + 1;
        sum += base * base * base;
        ++pairs;
      }
    }
    return sum / pairs;
  };
  const double wanted =
      double(mean_kernel(a, a, true) + mean_kernel(b, b, true) - 2 * mean_kernel(a, b, false));
  EXPECT_NEAR(kernel_distance(a, b), wanted, 1e-13);
  EXPECT_NEAR(kernel_distance(b, a), wanted, 1e-13);
}

TEST(KernelDistance, IsUnbiasedAndMayBeNegative) {
  double sum = 0, squares = 0;
  size_t below = 0;
  constexpr int kTrials = 400;
  for (uint64_t trial = 0; trial < kTrials; ++trial) {
    const double value =
        kernel_distance(random_rows(10, 4, 1000 + trial), random_rows(14, 4, 2000 + trial));
    sum += value;
    squares += value * value;
    if (value < 0) ++below;
  }
  EXPECT_LE(std::abs(sum / kTrials), 4 * std::sqrt(squares / kTrials / kTrials));
  EXPECT_GT(below, 100u);
}

TEST(KernelDistance, OfSubsetsIsTheWholeWhereTheyAreAllOfIt) {
  const RowMatrix a = random_rows(12, 3, 30), b = random_rows(12, 3, 31).array() + 1;
  const KernelDistance whole = kernel_distance(a, b, {.subsets = 5, .size = 12, .seed = 1});
  EXPECT_NEAR(whole.mean, kernel_distance(a, b), 1e-13);
  EXPECT_NEAR(whole.deviation, 0, 1e-13) << "the same items in another order";
  const KernelDistance parts = kernel_distance(a, b, {.subsets = 2000, .size = 6, .seed = 1});
  EXPECT_GT(parts.deviation, 0);
  EXPECT_NEAR(parts.mean, whole.mean, 4 * parts.deviation / std::sqrt(2000.0))
      << "means of pairs: subsets are as unbiased as the whole";
  EXPECT_EQ(parts.mean, kernel_distance(a, b, {.subsets = 2000, .size = 6, .seed = 1}).mean);
  EXPECT_NE(parts.mean, kernel_distance(a, b, {.subsets = 2000, .size = 6, .seed = 2}).mean);
}

TEST(FeatureDistances, RefuseSetsThatSayNothing) {
  const RowMatrix a = random_rows(5, 3, 40), other = random_rows(5, 4, 41),
                  one = random_rows(1, 3, 42), none(5, 0);
  RowMatrix broken = a;
  broken(2, 1) = std::nan("");
  for (const RowMatrix& bad : {other, one, none, broken}) {
    EXPECT_THROW(frechet_distance(a, bad), InputError);
    EXPECT_THROW(kernel_distance(a, bad), InputError);
  }
  EXPECT_THROW(kernel_distance(a, a, {.subsets = 3, .size = 6}), InputError);
  EXPECT_THROW(kernel_distance(a, a, {.subsets = 0, .size = 2}), InputError);
  EXPECT_THROW(kernel_distance(a, a, {.subsets = 3, .size = 1}), InputError);
}

}  // namespace
}  // namespace figurine::measure::frechet_test
