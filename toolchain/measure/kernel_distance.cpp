#include "toolchain/measure/kernel_distance.h"

#include <limits>
#include <string>
#include <vector>

#include "toolchain/error.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/random/stream.h"

namespace figurine::measure {

using random::RandomStream;
using random::RandomUse;

namespace {

void check(const RowMatrix& a, const RowMatrix& b) {
  if (a.rows() < 2 || b.rows() < 2)
    throw InputError("features: at least two items in each set are needed");
  if (a.cols() != b.cols() || a.cols() == 0)
    throw InputError("features: the two sets have different numbers of features, or none");
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

double estimate(const RowMatrix& a, const RowMatrix& b) {
  return mean_of_different(a) + mean_of_different(b) - 2 * kernel(a, b).mean();
}

// Means of V x V blocks.
RowMatrix kernel_of_people(const RowMatrix& a, const RowMatrix& b, size_t pictures) {
  const RowMatrix of_pictures = kernel(a, b);
  const auto v = static_cast<Eigen::Index>(pictures);
  RowMatrix people(of_pictures.rows() / v, of_pictures.cols() / v);
  for (Eigen::Index i = 0; i < people.rows(); ++i) {
    for (Eigen::Index j = 0; j < people.cols(); ++j)
      people(i, j) = of_pictures.block(i * v, j * v, v, v).mean();
  }
  return people;
}

double mean_of_different(const RowMatrix& kernels, const std::vector<size_t>& people) {
  double sum = 0;
  size_t pairs = 0;
  for (const size_t a : people) {
    for (const size_t b : people) {
      if (a == b) continue;
      sum += kernels(Eigen::Index(a), Eigen::Index(b));
      ++pairs;
    }
  }
  return pairs == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(pairs);
}

RowMatrix rows_of(const RowMatrix& set, const std::vector<size_t>& rows) {
  RowMatrix chosen(Eigen::Index(rows.size()), set.cols());
  for (size_t i = 0; i < rows.size(); ++i)
    chosen.row(Eigen::Index(i)) = set.row(Eigen::Index(rows[i]));
  return chosen;
}

}  // namespace

double kernel_distance(const RowMatrix& a, const RowMatrix& b) {
  check(a, b);
  return estimate(a, b);
}

KernelDistance kernel_distance(const RowMatrix& a, const RowMatrix& b,
                               const KernelSubsets& subsets) {
  check(a, b);
  const auto n = static_cast<size_t>(a.rows()), m = static_cast<size_t>(b.rows());
  if (subsets.subsets == 0 || subsets.size < 2 || subsets.size > n || subsets.size > m) {
    throw InputError("features: subsets of " + std::to_string(subsets.size) + " items of sets of " +
                     std::to_string(n) + " and " + std::to_string(m));
  }
  std::vector<double> values(subsets.subsets);
  for (size_t i = 0; i < values.size(); ++i) {
    const auto subset = [&](const RowMatrix& set, size_t which) {
      const RandomStream stream(subsets.seed, RandomUse::kFeatureSubset,
                                static_cast<uint32_t>(2 * i + which));
      return rows_of(set, stream.distinct(subsets.size, size_t(set.rows())));
    };
    values[i] = estimate(subset(a, 0), subset(b, 1));
  }
  const Summary summary = summarise(values);
  return {summary.mean, summary.standard_deviation};
}

KernelComparison::KernelComparison(const RowMatrix& samples, const RowMatrix& references,
                                   size_t pictures) {
  check(samples, references);
  const auto v = static_cast<Eigen::Index>(pictures);
  if (v < 1 || samples.rows() % v != 0 || references.rows() % v != 0 || samples.rows() < 2 * v ||
      references.rows() < 2 * v) {
    throw InputError("features: at least two people in each set are needed, of " +
                     std::to_string(pictures) + " pictures each");
  }
  between_ = kernel_of_people(samples, references, pictures);
  samples_ = kernel_of_people(samples, samples, pictures);
  references_ = kernel_of_people(references, references, pictures);
}

double KernelComparison::distance(const Items& items) const {
  double between = 0;
  for (const size_t s : items.samples) {
    for (const size_t r : items.references) between += between_(Eigen::Index(s), Eigen::Index(r));
  }
  between /= static_cast<double>(items.samples.size() * items.references.size());
  return mean_of_different(samples_, items.samples) +
         mean_of_different(references_, items.references) - 2 * between;
}

}  // namespace figurine::measure
