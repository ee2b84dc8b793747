#include "toolchain/evaluate/kernel_distance.h"

#include <string>
#include <vector>

#include "toolchain/error.h"
#include "toolchain/evaluate/random_stream.h"
#include "toolchain/evaluate/statistics.h"

namespace figurine::evaluate {

namespace {

void check(const RowMatrix& a, const RowMatrix& b) {
  if (a.rows() < 2 || b.rows() < 2) throw InputError("features: at least two items in each set are needed");
  if (a.cols() != b.cols() || a.cols() == 0) throw InputError("features: the two sets have different numbers of features, or none");
  if (!a.allFinite() || !b.allFinite()) throw InputError("features: a value is not finite");
}

RowMatrix kernel(const RowMatrix& a, const RowMatrix& b) {
  const RowMatrix product = a * b.transpose() / static_cast<double>(a.cols());
  return (product.array() + 1).cube().matrix();
}

double mean_of_different(const RowMatrix& a) {
  const RowMatrix of_pairs = kernel(a, a);
  const auto n = static_cast<double>(a.rows());
  return (of_pairs.sum() - of_pairs.trace()) / (n * (n - 1));
}

double estimate(const RowMatrix& a, const RowMatrix& b) { return mean_of_different(a) + mean_of_different(b) - 2 * kernel(a, b).mean(); }

RowMatrix rows_of(const RowMatrix& set, const std::vector<size_t>& rows) {
  RowMatrix chosen(Eigen::Index(rows.size()), set.cols());
  for (size_t i = 0; i < rows.size(); ++i) chosen.row(Eigen::Index(i)) = set.row(Eigen::Index(rows[i]));
  return chosen;
}

}  // namespace

double kernel_distance(const RowMatrix& a, const RowMatrix& b) {
  check(a, b);
  return estimate(a, b);
}

KernelDistance kernel_distance(const RowMatrix& a, const RowMatrix& b, const KernelSubsets& subsets) {
  check(a, b);
  const auto n = static_cast<size_t>(a.rows()), m = static_cast<size_t>(b.rows());
  if (subsets.subsets == 0 || subsets.size < 2 || subsets.size > n || subsets.size > m) {
    throw InputError("features: subsets of " + std::to_string(subsets.size) + " items of sets of " + std::to_string(n) + " and " +
                     std::to_string(m));
  }
  std::vector<double> values(subsets.subsets);
  for (size_t i = 0; i < values.size(); ++i) {
    const auto subset = [&](const RowMatrix& set, size_t which) {
      const RandomStream stream(subsets.seed, RandomUse::kFeatureSubset, static_cast<uint32_t>(2 * i + which));
      return rows_of(set, stream.distinct(subsets.size, size_t(set.rows())));
    };
    values[i] = estimate(subset(a, 0), subset(b, 1));
  }
  const Summary summary = summarise(values);
  return {summary.mean, summary.standard_deviation};
}

}  // namespace figurine::evaluate
