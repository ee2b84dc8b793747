#include "toolchain/measure/sample_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "toolchain/error.h"
#include "toolchain/measure/pooled_errors.h"

namespace figurine::measure {

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

void check(const RowMatrix& distances, Eigen::Index size, bool has_own_diagonal,
           const std::string& what) {
  if (distances.rows() != size || distances.cols() != size)
    throw InputError("sample metrics: distances of " + what + " do not fit the sets");
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      if (!std::isfinite(distances(i, j)) && !(has_own_diagonal && i == j)) {
        throw InputError("sample metrics: distance " + std::to_string(i) + ", " +
                         std::to_string(j) + " of " + what + " is not finite");
      }
    }
  }
}

// The nearest of what was added, and how many of those stand in the own set.
struct Nearest {
  double distance = kFar;
  size_t own = 0, all = 0;

  void add(double other, bool is_own) {
    if (other > distance) return;
    if (other < distance) *this = {other, 0, 0};
    ++all;
    if (is_own) ++own;
  }
  double own_share() const { return static_cast<double>(own) / static_cast<double>(all); }
};

double nearest_sample(const RowMatrix& to_references, const std::vector<size_t>& samples,
                      size_t reference) {
  double nearest = kFar;
  for (const size_t s : samples)
    nearest = std::min(nearest, to_references(Eigen::Index(s), Eigen::Index(reference)));
  return nearest;
}

double percent(double part, size_t whole) { return 100 * part / static_cast<double>(whole); }

}  // namespace

SampleComparison::SampleComparison(SampleDistances distances) : distances_(std::move(distances)) {
  const Eigen::Index samples = distances_.to_references.rows(),
                     references = distances_.to_references.cols();
  if (samples == 0 || references == 0)
    throw InputError("sample metrics: no samples or no references");
  if (samples != references) {
    throw InputError("sample metrics: " + std::to_string(samples) + " samples and " +
                     std::to_string(references) +
                     " references; as many of one as of the other are needed");
  }
  check(distances_.to_references, samples, false, "samples to references");
  check(distances_.samples, samples, true, "samples");
  check(distances_.references, samples, true, "references");
}

double SampleComparison::mmd(const Items& items) const {
  double sum = 0;
  for (const size_t r : items.references)
    sum += nearest_sample(distances_.to_references, items.samples, r);
  return sum / static_cast<double>(items.references.size());
}

double SampleComparison::mmd_psnr_db(const Items& items) const {
  double sum = 0;
  for (const size_t r : items.references)
    sum += psnr_db(nearest_sample(distances_.to_references, items.samples, r));
  return sum / static_cast<double>(items.references.size());
}

double SampleComparison::coverage_percent(const Items& items) const {
  std::vector<bool> met(size(), false);
  for (const size_t s : items.samples) {
    const auto row = distances_.to_references.row(Eigen::Index(s));
    double nearest = kFar;
    for (const size_t r : items.references) nearest = std::min(nearest, row[Eigen::Index(r)]);
    for (const size_t r : items.references) {
      if (row[Eigen::Index(r)] == nearest) met[r] = true;
    }
  }
  const auto covered = std::count_if(items.references.begin(), items.references.end(),
                                     [&](size_t r) { return met[r]; });
  return percent(static_cast<double>(covered), items.references.size());
}

double SampleComparison::one_nna_percent(const Items& items) const {
  double right = 0;
  for (const size_t s : items.samples) {
    Nearest nearest;
    for (const size_t other : items.samples) {
      if (other != s) nearest.add(distances_.samples(Eigen::Index(s), Eigen::Index(other)), true);
    }
    for (const size_t r : items.references)
      nearest.add(distances_.to_references(Eigen::Index(s), Eigen::Index(r)), false);
    right += nearest.own_share();
  }
  for (const size_t r : items.references) {
    Nearest nearest;
    for (const size_t other : items.references) {
      if (other != r)
        nearest.add(distances_.references(Eigen::Index(r), Eigen::Index(other)), true);
    }
    for (const size_t s : items.samples)
      nearest.add(distances_.to_references(Eigen::Index(s), Eigen::Index(r)), false);
    right += nearest.own_share();
  }
  return percent(right, items.samples.size() + items.references.size());
}

SampleMetrics sample_metrics(const SampleComparison& comparison) {
  const Items all = comparison.all();
  const double one_nna = comparison.one_nna_percent(all);
  return {comparison.mmd(all), comparison.coverage_percent(all), one_nna, std::abs(one_nna - 50)};
}

std::vector<SampleComparison> disjoint_draws(const SampleDistances& distances) {
  const Eigen::Index size = distances.to_references.cols(),
                     samples = distances.to_references.rows();
  if (size == 0 || samples < size || distances.samples.rows() != samples ||
      distances.samples.cols() != samples) {
    throw InputError("sample metrics: " + std::to_string(samples) + " samples cannot be drawn as " +
                     std::to_string(size));
  }
  std::vector<SampleComparison> draws;
  for (Eigen::Index first = 0; first + size <= samples; first += size) {
    draws.push_back(SampleComparison({distances.to_references.middleRows(first, size),
                                      distances.samples.block(first, first, size, size),
                                      distances.references}));
  }
  return draws;
}

}  // namespace figurine::measure
