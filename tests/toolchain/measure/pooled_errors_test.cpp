// Pooled errors against hand-computed ones and a brute-force loop in long double.
#include "toolchain/measure/pooled_errors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/largest_error.h"
#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"

namespace figurine::measure::pooled_errors_test {
namespace {

// Values in [0,1] as pictures of 8 bits have them.
PictureRows pictures(Eigen::Index items, Eigen::Index values, uint64_t seed) {
  const RowMatrix normal = tests::random_rows(items, values, seed);
  return normal.unaryExpr(
      [](double x) { return float(std::lround(255 / (1 + std::exp(-x)))) / 255; });
}

TEST(PooledErrors, PoolBeforeTheLogarithm) {
  // Two items of two pictures of two values: errors 1 and 0 pool to 1/2, not to the mean of 0 dB
  // and infinity.
  PictureRows a(1, 4), b(2, 4);
  a << 0, 0, 0.5f, 0.5f;
  b << 1, 1, 0.5f, 0.5f,  //
      0, 0, 0.5f, 0.25f;
  const RowMatrix mse = pooled_mse(a, b);
  EXPECT_DOUBLE_EQ(mse(0, 0), 0.5);
  EXPECT_DOUBLE_EQ(mse(0, 1), 0.0625 / 4);
  EXPECT_NEAR(psnr_db(mse(0, 0)), 3.010299956639812, 1e-14);
  EXPECT_NEAR(psnr_db(0.01), 20, 1e-14);
  EXPECT_EQ(psnr_db(0), INFINITY);
}

TEST(PooledErrors, EqualBruteForce) {
  // Sizes that leave remainders in every tile.
  const PictureRows a = pictures(19, 2051, 1), b = pictures(33, 2051, 2);
  const RowMatrix mse = pooled_mse(a, b);
  LargestError error("pooled mse, relative");
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j < b.rows(); ++j) {
      long double sum = 0;
      for (Eigen::Index p = 0; p < a.cols(); ++p)
        sum += ((long double)a(i, p) - b(j, p)) * ((long double)a(i, p) - b(j, p));
      error.add(double(mse(i, j) / (sum / a.cols()) - 1));
    }
  }
  EXPECT_LE(error.largest(), 1e-14);
}

TEST(PooledErrors, OfASetWithItselfAreSymmetricAndNothingOnTheDiagonal) {
  PictureRows a = pictures(37, 1500, 3);
  a.row(20) = a.row(3);
  const RowMatrix mse = pooled_mse(a);
  EXPECT_EQ(mse, mse.transpose());
  EXPECT_EQ(mse.diagonal().maxCoeff(), 0);
  EXPECT_EQ(mse(20, 3), 0) << "a twin";
  EXPECT_EQ(mse, pooled_mse(a, a)) << "to the bit what two sets would give";
}

TEST(PooledErrors, PortionsAddUp) {
  const PictureRows a = pictures(5, 3000, 4), b = pictures(6, 3000, 5);
  PooledErrors errors(5, 6), own(5, 5);
  errors.add(a.leftCols(1024), b.leftCols(1024));
  errors.add(a.rightCols(1976), b.rightCols(1976));
  own.add(a.leftCols(1));
  own.add(a.rightCols(2999));
  EXPECT_LT((errors.mse() - pooled_mse(a, b)).cwiseAbs().maxCoeff(), 1e-16);
  EXPECT_LT((own.mse() - pooled_mse(a)).cwiseAbs().maxCoeff(), 1e-16);
}

TEST(PooledErrors, RefuseWhatCannotBeCompared) {
  const PictureRows a = pictures(2, 8, 6), b = pictures(2, 7, 7);
  EXPECT_THROW(pooled_mse(a, b), InputError);
  EXPECT_THROW(PooledErrors(2, 3).add(a), InputError);
  EXPECT_THROW(PooledErrors(3, 2).add(a, a), InputError);
  EXPECT_THROW(PooledErrors(2, 2).mse(), InputError);
}

}  // namespace
}  // namespace figurine::measure::pooled_errors_test
