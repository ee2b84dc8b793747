#include "toolchain/generation/novelty.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "figurine/check.h"
#include "toolchain/error.h"
#include "toolchain/measure/statistics.h"

namespace figurine::generation {

using measure::quantile;
using measure::RowMatrix;

namespace {

constexpr double kCopyQuantile = 0.05;

std::vector<NearestMember> nearest_of_rows(const RowMatrix& distances, bool skip_diagonal) {
  if (distances.rows() == 0 || distances.cols() < (skip_diagonal ? 2 : 1))
    throw InputError("novelty: nobody to be near to");
  std::vector<NearestMember> nearest;
  for (Eigen::Index i = 0; i < distances.rows(); ++i) {
    NearestMember best{0, INFINITY};
    for (Eigen::Index n = 0; n < distances.cols(); ++n) {
      if (skip_diagonal && n == i) continue;
      if (!std::isfinite(distances(i, n))) throw InputError("novelty: a distance is not finite");
      if (distances(i, n) < best.distance) best = {static_cast<size_t>(n), distances(i, n)};
    }
    nearest.push_back(best);
  }
  return nearest;
}

std::vector<double> distances_of(const std::vector<NearestMember>& nearest) {
  std::vector<double> distances;
  for (const NearestMember& one : nearest) distances.push_back(one.distance);
  return distances;
}

double share_up_to(const std::vector<double>& values, double limit) {
  const auto count =
      std::count_if(values.begin(), values.end(), [&](double value) { return value <= limit; });
  return static_cast<double>(count) / static_cast<double>(values.size());
}

}  // namespace

std::vector<NearestMember> nearest_members(const RowMatrix& to_training) {
  return nearest_of_rows(to_training, false);
}

std::vector<NearestMember> nearest_other_members(const RowMatrix& training) {
  if (training.rows() != training.cols())
    throw InputError("novelty: distances of members to each other do not fit");
  return nearest_of_rows(training, true);
}

Novelty measure_novelty(const RowMatrix& to_training, const RowMatrix& training) {
  if (to_training.cols() != training.rows())
    throw InputError("novelty: distances to members and of members do not fit");
  Novelty novelty{nearest_members(to_training), nearest_other_members(training)};
  const std::vector<double> samples = distances_of(novelty.samples),
                            members = distances_of(novelty.training);
  novelty.median_ratio = quantile(samples, 0.5) / quantile(members, 0.5);
  novelty.copy_distance = quantile(members, kCopyQuantile);
  novelty.copy_share = share_up_to(samples, novelty.copy_distance);
  std::set<size_t> met;
  for (const NearestMember& one : novelty.samples) met.insert(one.member);
  novelty.members_met = met.size();
  return novelty;
}

std::vector<BlendShare> measure_blends(const RowMatrix& samples, const RowMatrix& training,
                                       size_t most, const RunPieces& run) {
  FIG_CHECK(most >= 1, "at least one member");
  if (samples.rows() == 0 || training.rows() < 2)
    throw InputError("novelty: at least one sample and two members are needed");
  if (samples.cols() != training.cols())
    throw InputError("novelty: samples and members are of different sizes");
  if (!samples.allFinite() || !training.allFinite())
    throw InputError("novelty: a value is not finite");
  const auto members = static_cast<size_t>(training.rows());
  const size_t few = std::min(most, members);
  std::vector<BlendShare> shares(few + 1);
  for (size_t k = 0; k < few; ++k) shares[k].members = k + 1;
  shares[few].members = members;
  const auto count = static_cast<size_t>(samples.rows());
  for (BlendShare& share : shares) share.residuals.resize(count);
  const BlendSearch search(training);
  const auto measure = [&](size_t s) {
    const Blends blends = search.closest(samples.row(static_cast<Eigen::Index>(s)), few);
    for (size_t k = 0; k < few; ++k) shares[k].residuals[s] = blends.of_few[k].relative_residual;
    shares[few].residuals[s] = blends.of_any.relative_residual;
  };
  if (run) {
    run(count, measure);
  } else {
    for (size_t s = 0; s < count; ++s) measure(s);
  }
  for (BlendShare& share : shares) {
    share.median_residual = quantile(share.residuals, 0.5);
    share.explained_share = share_up_to(share.residuals, kExplainedResidual);
  }
  return shares;
}

}  // namespace figurine::generation
