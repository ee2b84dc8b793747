#include "toolchain/generation/baselines.h"

#include <string>
#include <vector>

#include "toolchain/error.h"
#include "toolchain/random/stream.h"

namespace figurine::generation {

using measure::RowMatrix;
using measure::RowVector;
using random::RandomStream;
using random::RandomUse;

namespace {

void check(const RowMatrix& training) {
  if (training.rows() == 0 || training.cols() == 0)
    throw InputError("baselines: no members to draw from");
}

// Row i from what make says of item first + i.
template <class Make>
RowMatrix draw_rows(const RowMatrix& training, const Draw& draw, Make&& make) {
  RowMatrix rows(Eigen::Index(draw.count), training.cols());
  for (size_t i = 0; i < draw.count; ++i)
    rows.row(Eigen::Index(i)) = make(static_cast<uint32_t>(draw.first + i));
  return rows;
}

Eigen::VectorXd normal_values(uint64_t seed, RandomUse use, uint32_t item, Eigen::Index count) {
  Eigen::VectorXd values(count);
  RandomStream(seed, use, item).fill_normal({values.data(), static_cast<size_t>(count)});
  return values;
}

// 1 where members differ, else 0. Exact: a mean of equal values may differ from them.
RowVector varying(const RowMatrix& training) {
  RowVector mask(training.cols());
  for (Eigen::Index d = 0; d < training.cols(); ++d)
    mask[d] = (training.col(d).array() == training(0, d)).all() ? 0 : 1;
  return mask;
}

RowVector mean_of(const RowMatrix& training, const RowVector& mask) {
  return (mask.array() > 0).select(training.colwise().mean(), training.row(0));
}

}  // namespace

RowMatrix draw_independent_gaussian(const RowMatrix& training, const Draw& draw) {
  check(training);
  const RowVector mask = varying(training), mean = mean_of(training, mask);
  const RowVector deviation =
      ((training.rowwise() - mean).array().square().colwise().mean().sqrt() * mask.array())
          .matrix();
  return draw_rows(training, draw, [&](uint32_t item) -> RowVector {
    const Eigen::VectorXd normal =
        normal_values(draw.seed, RandomUse::kGaussianValues, item, training.cols());
    return mean + deviation.cwiseProduct(normal.transpose());
  });
}

RowMatrix draw_gaussian(const RowMatrix& training, const Draw& draw) {
  check(training);
  const RowVector mean = mean_of(training, varying(training));
  const RowMatrix centred =
      (training.rowwise() - mean) / std::sqrt(static_cast<double>(training.rows()));
  return draw_rows(training, draw, [&](uint32_t item) -> RowVector {
    return mean + normal_values(draw.seed, RandomUse::kGaussianMixture, item, training.rows())
                          .transpose() *
                      centred;
  });
}

RowMatrix draw_averages(const RowMatrix& training, size_t m, const Draw& draw) {
  check(training);
  const auto members = static_cast<size_t>(training.rows());
  if (m == 0 || m > members)
    throw InputError("baselines: averages of " + std::to_string(m) + " of " +
                     std::to_string(members) + " members");
  const RowVector mask = varying(training);
  return draw_rows(training, draw, [&](uint32_t item) -> RowVector {
    RowVector sum = RowVector::Zero(training.cols());
    for (const size_t n :
         RandomStream(draw.seed, RandomUse::kAveragedMembers, item).distinct(m, members))
      sum += training.row(Eigen::Index(n));
    return (mask.array() > 0).select(sum / static_cast<double>(m), training.row(0));
  });
}

RowMatrix draw_noised_members(const RowMatrix& training, double noise_rms, const Draw& draw) {
  check(training);
  const RowVector deviation = noise_rms * varying(training);
  return draw_rows(training, draw, [&](uint32_t item) -> RowVector {
    const size_t member =
        RandomStream(draw.seed, RandomUse::kNoisedMember, item).index(0, size_t(training.rows()));
    const Eigen::VectorXd normal =
        normal_values(draw.seed, RandomUse::kMemberNoise, item, training.cols());
    return training.row(Eigen::Index(member)) + deviation.cwiseProduct(normal.transpose());
  });
}

RowMatrix draw_members(const RowMatrix& training, const Draw& draw) {
  check(training);
  return draw_rows(training, draw, [&](uint32_t item) -> RowVector {
    return training.row(Eigen::Index(RandomStream(draw.seed, RandomUse::kChosenMembers, item)
                                         .index(0, size_t(training.rows()))));
  });
}

}  // namespace figurine::generation
