// The rows to beat: their moments, what they are made of, and that sample i does not depend on the
// others.
#include "toolchain/generation/baselines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"

namespace figurine::generation::baselines_test {

using measure::rms_distances;
using measure::RowMatrix;
using measure::RowVector;

namespace {

using tests::random_rows;

// Correlated values of unequal means and variances; the last one is shared by all and no binary
// fraction.
RowMatrix members(Eigen::Index count) {
  RowMatrix training = random_rows(count, 6, 1) * random_rows(6, 6, 2);
  training.rowwise() += RowVector::LinSpaced(6, -3, 3);
  training.col(5).setConstant(0.1);
  return training;
}

Eigen::MatrixXd covariance(const RowMatrix& rows) {
  const RowMatrix centred = rows.rowwise() - rows.colwise().mean();
  return centred.transpose() * centred / double(rows.rows());
}

const std::map<const char*, std::function<RowMatrix(const RowMatrix&, const Draw&)>> kAll = {
    {"independent Gaussian", draw_independent_gaussian},
    {"Gaussian", draw_gaussian},
    {"average of 2",
     [](const RowMatrix& training, const Draw& draw) { return draw_averages(training, 2, draw); }},
    {"average of 5",
     [](const RowMatrix& training, const Draw& draw) { return draw_averages(training, 5, draw); }},
    {"member + noise", [](const RowMatrix& training,
                          const Draw& draw) { return draw_noised_members(training, 0.2, draw); }},
    {"member", draw_members},
};

TEST(GenerationBaselines, ASampleDependsOnSeedAndIndexAlone) {
  const RowMatrix training = members(9);
  for (const auto& [name, draw] : kAll) {
    const RowMatrix many = draw(training, {.count = 20, .seed = 5}),
                    few = draw(training, {.count = 7, .seed = 5});
    const RowMatrix late = draw(training, {.count = 3, .seed = 5, .first = 12});
    EXPECT_EQ(many.topRows(7), few) << name;
    EXPECT_EQ(many.middleRows(12, 3), late) << name;
    EXPECT_NE(many, draw(training, {.count = 20, .seed = 6})) << name;
    EXPECT_EQ(draw(training, {.count = 0}).rows(), 0) << name;
  }
}

TEST(GenerationBaselines, WhatAllMembersShareStaysToTheBit) {
  const RowMatrix training = members(7);
  for (const auto& [name, draw] : kAll) {
    EXPECT_TRUE((draw(training, {.count = 50}).col(5).array() == 0.1).all()) << name;
  }
  for (const auto& [name, draw] : kAll) {
    if (std::string(name) == "average of 5" || std::string(name) == "average of 2") continue;
    const RowMatrix only = draw(training.topRows(1), {.count = 2});
    EXPECT_EQ(only.row(1), training.row(0)) << name << " of a single member is that member";
  }
}

TEST(GenerationBaselines, GaussiansHaveTheMomentsAskedFor) {
  const RowMatrix training = members(12);
  constexpr size_t kCount = 100'000;
  const Eigen::MatrixXd wanted = covariance(training);
  const RowMatrix independent = draw_independent_gaussian(training, {.count = kCount, .seed = 7});
  const RowMatrix whole = draw_gaussian(training, {.count = kCount, .seed = 7});
  const Eigen::MatrixXd of_independent = covariance(independent), of_whole = covariance(whole);
  for (Eigen::Index i = 0; i < 6; ++i) {
    // Four standard errors: of a mean sqrt(v / n), of a covariance at most sqrt(2 v_i v_j / n).
    const double mean_limit = 4 * std::sqrt(wanted(i, i) / kCount) + 1e-12;
    EXPECT_NEAR(independent.col(i).mean(), training.col(i).mean(), mean_limit);
    EXPECT_NEAR(whole.col(i).mean(), training.col(i).mean(), mean_limit);
    for (Eigen::Index j = 0; j < 6; ++j) {
      const double limit = 4 * std::sqrt(2 * wanted(i, i) * wanted(j, j) / kCount) + 1e-12;
      EXPECT_NEAR(of_whole(i, j), wanted(i, j), limit) << i << " " << j;
      EXPECT_NEAR(of_independent(i, j), i == j ? wanted(i, j) : 0, limit) << i << " " << j;
    }
  }
  EXPECT_GT(std::abs(wanted(0, 1)), 8 * std::sqrt(2 * wanted(0, 0) * wanted(1, 1) / kCount))
      << "or the two could not be told apart";
}

TEST(GenerationBaselines, TheWholeGaussianStaysInTheMembersSpan) {
  const RowMatrix training = random_rows(5, 40, 3);
  const RowMatrix samples = draw_gaussian(training, {.count = 10, .seed = 1});
  const RowMatrix centred = training.rowwise() - training.colwise().mean();
  const Eigen::MatrixXd basis =
      Eigen::BDCSVD<Eigen::MatrixXd>(centred, Eigen::ComputeThinV).matrixV().leftCols(4);
  const RowMatrix away = samples.rowwise() - training.colwise().mean();
  EXPECT_LT((away - away * basis * basis.transpose()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_GT(away.norm(), 1);
}

TEST(GenerationBaselines, AveragesAreMeansOfDifferentMembers) {
  const RowMatrix training = random_rows(6, 30, 4);
  const RowMatrix samples = draw_averages(training, 3, {.count = 200, .seed = 2});
  // Weights of the members by least squares: they are independent.
  const Eigen::MatrixXd weights = Eigen::HouseholderQR<Eigen::MatrixXd>(training.transpose())
                                      .solve(Eigen::MatrixXd(samples.transpose()));  // [N,count]
  Eigen::VectorXd used = Eigen::VectorXd::Zero(6);
  for (Eigen::Index i = 0; i < 200; ++i) {
    EXPECT_EQ((weights.col(i).array() - 1.0 / 3 > -1e-12).count(), 3) << i;
    EXPECT_LT(weights.col(i)
                  .cwiseProduct((weights.col(i).array() - 1.0 / 3).matrix())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-12);
    used += weights.col(i);
  }
  EXPECT_GT(used.minCoeff(), 200.0 / 6 * 0.7);
  EXPECT_LT((draw_averages(training, 6, {.count = 1}).row(0) - training.colwise().mean()).norm(),
            1e-14);
  const RowVector one = draw_averages(training, 1, {.count = 1}).row(0);
  EXPECT_EQ((training.rowwise() - one).rowwise().norm().minCoeff(), 0)
      << "an average of one is a member";
}

TEST(GenerationBaselines, MembersComeOftenAndNoiseIsAsLoudAsAsked) {
  const RowMatrix training = random_rows(4, 3000, 5);
  const RowMatrix copies = draw_members(training, {.count = 400, .seed = 3});
  std::vector<size_t> counts(4, 0);
  for (Eigen::Index i = 0; i < 400; ++i) {
    for (Eigen::Index n = 0; n < 4; ++n)
      counts[size_t(n)] += copies.row(i) == training.row(n) ? 1 : 0;
  }
  EXPECT_EQ(counts[0] + counts[1] + counts[2] + counts[3], 400u);
  for (const size_t count : counts) EXPECT_NEAR(double(count), 100, 4 * std::sqrt(75.0));
  const RowMatrix noised = draw_noised_members(training, 0.01, {.count = 20, .seed = 3});
  const RowMatrix distances = rms_distances(noised, training, 3000);
  for (Eigen::Index i = 0; i < 20; ++i)
    EXPECT_NEAR(distances.row(i).minCoeff(), 0.01, 4 * 0.01 / std::sqrt(6000.0));
  const RowVector silent = draw_noised_members(training, 0, {.count = 1}).row(0);
  EXPECT_EQ((training.rowwise() - silent).rowwise().norm().minCoeff(), 0) << "no noise is a member";
}

TEST(GenerationBaselines, RefuseWhatCannotBeDrawn) {
  const RowMatrix none(0, 3), empty(3, 0), two = RowMatrix::Ones(2, 3);
  for (const auto& [name, draw] : kAll) {
    EXPECT_THROW(draw(none, {.count = 1}), InputError) << name;
    EXPECT_THROW(draw(empty, {.count = 1}), InputError) << name;
  }
  EXPECT_THROW(draw_averages(two, 3, {.count = 1}), InputError);
  EXPECT_THROW(draw_averages(two, 0, {.count = 1}), InputError);
}

}  // namespace
}  // namespace figurine::generation::baselines_test
