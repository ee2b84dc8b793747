#include "toolchain/measure/pooled_errors.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"
#include "toolchain/measure/widest_vectors.h"

namespace figurine::measure {

namespace {

// 16 rows of 1,024 doubles of each set: 256 KiB, what a core's second cache holds.
constexpr Eigen::Index kRows = 16, kValues = 1024;

// Lanes of their own, so that the compiler may put them side by side; the machine's widest vectors
// do.
FIG_WIDEST_VECTORS double squared_distance(const double* a, const double* b, Eigen::Index count) {
  constexpr Eigen::Index kLanes = 32;
  double sums[kLanes] = {};
  Eigen::Index i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      const double difference = a[i + lane] - b[i + lane];
      sums[lane] += difference * difference;
    }
  }
  double sum = 0;
  for (; i < count; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  for (const double lane : sums) sum += lane;
  return sum;
}

void add_tile(const RowMatrix& a, const RowMatrix& b, Eigen::Index first_a, Eigen::Index first_b,
              RowMatrix& sums) {
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j < b.rows(); ++j) {
      sums(first_a + i, first_b + j) +=
          squared_distance(a.row(i).data(), b.row(j).data(), a.cols());
    }
  }
}

// Pairs of the tiles on and above the diagonal alone, if it is one set.
void add_pairs(const PictureRows& a, const PictureRows& b, bool one_set, RowMatrix& sums) {
  for (Eigen::Index value = 0; value < a.cols(); value += kValues) {
    const Eigen::Index values = std::min(kValues, a.cols() - value);
    const auto rows = [&](const PictureRows& set, Eigen::Index first) -> RowMatrix {
      return set.block(first, value, std::min(kRows, set.rows() - first), values).cast<double>();
    };
    for (Eigen::Index i = 0; i < a.rows(); i += kRows) {
      const RowMatrix tile = rows(a, i);
      for (Eigen::Index j = one_set ? i : 0; j < b.rows(); j += kRows)
        add_tile(tile, rows(b, j), i, j, sums);
    }
  }
}

}  // namespace

void PooledErrors::add(const PictureRows& a, const PictureRows& b) {
  if (a.rows() != sums_.rows() || b.rows() != sums_.cols() || a.cols() != b.cols()) {
    throw InputError("compared pictures: every item needs the same pictures of the same size");
  }
  add_pairs(a, b, false, sums_);
  values_ += static_cast<double>(a.cols());
}

void PooledErrors::add(const PictureRows& a) {
  if (a.rows() != sums_.rows() || a.rows() != sums_.cols())
    throw InputError("compared pictures: a set is compared with itself");
  add_pairs(a, a, true, sums_);
  for (Eigen::Index i = 0; i < sums_.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) sums_(i, j) = sums_(j, i);
  }
  values_ += static_cast<double>(a.cols());
}

RowMatrix PooledErrors::mse() const {
  if (values_ == 0) throw InputError("compared pictures: there is nothing to compare");
  return sums_ / values_;
}

RowMatrix pooled_mse(const PictureRows& a, const PictureRows& b) {
  PooledErrors errors(size_t(a.rows()), size_t(b.rows()));
  errors.add(a, b);
  return errors.mse();
}

RowMatrix pooled_mse(const PictureRows& a) {
  PooledErrors errors(size_t(a.rows()), size_t(a.rows()));
  errors.add(a);
  return errors.mse();
}

double psnr_db(double mse) { return -10 * std::log10(mse); }

}  // namespace figurine::measure
