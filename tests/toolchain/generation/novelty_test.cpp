// The audit of samples on generators whose verdict is known: memorisers, averages, noise, and
// people of their own.
#include "toolchain/generation/novelty.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/largest_error.h"
#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"
#include "toolchain/generation/baselines.h"
#include "toolchain/measure/pooled_errors.h"

namespace figurine::generation::novelty_test {

using measure::PictureRows;
using measure::pooled_mse;
using measure::rms_distances;
using measure::RowMatrix;
using measure::RowVector;

namespace {

using tests::random_rows;

// Of z: how far the conditions for the least norm in a hull are from being met, relative to the
// largest product.
double violation(const Eigen::MatrixXd& gram, const Eigen::VectorXd& weights) {
  const Eigen::VectorXd products = gram * weights;
  const double norm2 = weights.dot(products), scale = gram.diagonal().maxCoeff();
  // Nobody lies nearer than the point itself (Wolfe, theorem 1); weights are those of a mixture.
  return std::max(
      {(norm2 - products.minCoeff()) / scale, -weights.minCoeff(), std::abs(weights.sum() - 1)});
}

TEST(LeastNormWeights, AreWhatAHandFinds) {
  // Points of the plane as rows; the origin is the target.
  const auto weights_of = [](const RowMatrix& points) {
    return least_norm_weights(points * points.transpose());
  };
  RowMatrix segment(2, 2), corner(2, 2), triangle(3, 2), twins(3, 2);
  segment << -1, 1, 3, 1;  // nearest is (0,1)
  EXPECT_LT((weights_of(segment) - Eigen::Vector2d(0.75, 0.25)).norm(), 1e-14);
  corner << 1, 1, 3, 1;  // nearest is the first point
  EXPECT_LT((weights_of(corner) - Eigen::Vector2d(1, 0)).norm(), 1e-14);
  triangle << 2, 0, -1, 1, -1, -1;  // the origin lies inside
  EXPECT_LT((weights_of(triangle) - Eigen::Vector3d(1.0 / 3, 1.0 / 3, 1.0 / 3)).norm(), 1e-14);
  twins << -1, 1, 3, 1, 3, 1;
  const Eigen::VectorXd weights = weights_of(twins);
  EXPECT_NEAR(weights[0], 0.75, 1e-12);
  EXPECT_NEAR(weights[1] + weights[2], 0.25, 1e-12);
  EXPECT_EQ(least_norm_weights(Eigen::MatrixXd::Constant(1, 1, 5.0))[0], 1);
  EXPECT_NEAR(least_norm_weights(Eigen::MatrixXd::Zero(3, 3)).sum(), 1, 1e-15)
      << "everybody at the target";
}

TEST(LeastNormWeights, MeetTheConditionsOfTheLeastNorm) {
  LargestError error("violated conditions of the least norm");
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const Eigen::Index n = 2 + Eigen::Index(seed) % 40, d = 1 + Eigen::Index(seed * 7) % 50;
    // Near and far from the hull; more points than dimensions as well, where weights are not
    // unique.
    const RowMatrix points = random_rows(n, d, seed).array() + (seed % 3) * 0.3;
    const Eigen::MatrixXd gram = points * points.transpose();
    error.add(std::max(0.0, violation(gram, least_norm_weights(gram))));
  }
  EXPECT_LE(error.largest(), 1e-11);
}

TEST(BlendSearch, FindsAveragesWhateverLiesBetween) {
  // Members of very different length: the short ones lie nearer to an average of five than its
  // members do.
  RowMatrix training = random_rows(40, 300, 1);
  for (Eigen::Index n = 20; n < 40; ++n) training.row(n) *= 0.1;
  const BlendSearch search(training);
  LargestError error("relative residual of averages");
  for (size_t m = 1; m <= 5; ++m) {
    RowVector average = RowVector::Zero(300);
    for (size_t n = 0; n < m; ++n) average += training.row(Eigen::Index(3 * n)) / double(m);
    const Blends blends = search.closest(average, 5);
    ASSERT_EQ(blends.of_few.size(), 5u);
    for (size_t k = 1; k <= 5; ++k) {
      const Blend& blend = blends.of_few[k - 1];
      EXPECT_LE(blend.members.size(), k);
      if (k > 1) {
        EXPECT_LE(blend.relative_residual, blends.of_few[k - 2].relative_residual);
      }
      if (k < m) {
        EXPECT_GT(blend.relative_residual, 0.2) << "no average of " << m << " is one of " << k;
      } else {
        error.add(blend.relative_residual);
        // At rounding more members may lend a weight of 1e-16: the average's own carry all.
        double own = 0;
        for (size_t i = 0; i < blend.members.size(); ++i) {
          if (blend.members[i] % 3 == 0 && blend.members[i] < 3 * m) own += blend.weights[i];
        }
        EXPECT_NEAR(own, 1, 1e-9);
      }
    }
    error.add(blends.of_any.relative_residual);
  }
  EXPECT_LE(error.largest(), 1e-9);
}

TEST(BlendSearch, FindsUnequalBlendsAndTellsWhatIsLeft) {
  const RowMatrix training = random_rows(30, 200, 2);
  const BlendSearch search(training);
  const RowVector blend = 0.9 * training.row(4) + 0.1 * training.row(17);
  EXPECT_LE(search.closest(blend, 2).of_few[1].relative_residual, 1e-9);
  // What no member can explain: a direction orthogonal to all of them and to their mean.
  RowVector outside = random_rows(1, 200, 3).row(0);
  const Eigen::MatrixXd span =
      Eigen::HouseholderQR<Eigen::MatrixXd>(training.transpose()).householderQ() *
      Eigen::MatrixXd::Identity(200, 30);
  outside -= outside * span * span.transpose();
  outside *= 3 / outside.norm();
  const Blends left = search.closest(blend + outside, 2);
  const double whole = (blend + outside - training.colwise().mean()).norm();
  EXPECT_NEAR(left.of_few[1].relative_residual, 3 / whole, 1e-9);
  EXPECT_NEAR(left.of_any.relative_residual, 3 / whole, 1e-9);
}

TEST(BlendSearch, TheTrainingMeanIsABlendOfAllAndOfNoFew) {
  const RowMatrix training = random_rows(10, 50, 4);
  const Blends blends = BlendSearch(training).closest(training.colwise().mean(), 50);
  EXPECT_EQ(blends.of_few.size(), 10u) << "no more than there are";
  EXPECT_GT(blends.of_few[4].relative_residual, 1) << "the mean explains it better";
}

TEST(Novelty, AMemoriserIsFoundOut) {
  const RowMatrix training = random_rows(50, 100, 10);
  const RowMatrix samples = draw_members(training, {.count = 80, .seed = 1});
  const Novelty novelty = measure_novelty(rms_distances(samples, training, 100),
                                          rms_distances(training, training, 100));
  EXPECT_LT(novelty.median_ratio, 1e-6) << "distances by products are rounding below 1e-7";
  EXPECT_EQ(novelty.copy_share, 1);
  for (Eigen::Index s = 0; s < 80; ++s)
    EXPECT_EQ(RowVector(training.row(Eigen::Index(novelty.samples[size_t(s)].member))),
              samples.row(s));
  const std::vector<BlendShare> shares = measure_blends(samples, training, 2);
  ASSERT_EQ(shares.size(), 3u);
  EXPECT_EQ(shares[0].explained_share, 1);
  EXPECT_EQ(shares[0].median_residual, 0);
}

TEST(Novelty, PicturesOfAMemoriserAreExactlyNothingAway) {
  const PictureRows people = (0.5 + 0.1 * random_rows(12, 60, 11).array()).matrix().cast<float>();
  const PictureRows samples = people.topRows(5);
  const Novelty novelty = measure_novelty(pooled_mse(samples, people), pooled_mse(people));
  EXPECT_EQ(novelty.median_ratio, 0);
  EXPECT_EQ(novelty.copy_share, 1);
  EXPECT_EQ(novelty.members_met, 5u);
}

TEST(Novelty, NewPeopleAreAsFarAsTrainingMembersAre) {
  const RowMatrix everybody = random_rows(220, 100, 12);
  const RowMatrix training = everybody.topRows(200), held_out = everybody.bottomRows(20);
  const RowMatrix among = rms_distances(training, training, 100);
  const Novelty novelty = measure_novelty(rms_distances(held_out, training, 100), among);
  EXPECT_NEAR(novelty.median_ratio, 1, 0.03);
  EXPECT_LE(novelty.copy_share, 0.25);
  // Averages of two are nearer than anybody new, and a blend of two explains all of them but none
  // of the new.
  const RowMatrix averages = draw_averages(training, 2, {.count = 30, .seed = 3});
  EXPECT_LT(measure_novelty(rms_distances(averages, training, 100), among).median_ratio, 0.7);
  const std::vector<BlendShare> of_averages = measure_blends(averages, training, 3),
                                of_new = measure_blends(held_out, training, 3);
  EXPECT_EQ(of_averages[0].explained_share, 0);
  EXPECT_EQ(of_averages[1].explained_share, 1);
  EXPECT_LE(of_averages[1].median_residual, 1e-9);
  EXPECT_EQ(of_averages[3].members, 200u);
  EXPECT_EQ(of_new[2].explained_share, 0);
  EXPECT_GT(of_new[2].median_residual, 0.8);
}

TEST(Novelty, CountsWhatAHandCounts) {
  RowMatrix training(4, 4), samples(3, 4);
  // Nearest others: 1, 1, 2, 3 (the diagonal would be nearer), so the median is 1.5 and the 5th
  // percentile 1.
  training << 0, 1, 4, 5,  //
      1, 0, 4, 5,          //
      4, 2, 0, 5,          //
      3, 4, 5, 0;
  samples << 2, 0.5, 3, 3,  //
      1, 1, 7, 1,           //
      9, 8, 6, 9;
  const Novelty novelty = measure_novelty(samples, training);
  EXPECT_DOUBLE_EQ(novelty.median_ratio, 1 / 1.5);
  EXPECT_DOUBLE_EQ(novelty.copy_distance, 1);
  EXPECT_DOUBLE_EQ(novelty.copy_share, 2.0 / 3);
  EXPECT_EQ(novelty.samples[0].member, 1u);
  EXPECT_EQ(novelty.samples[1].member, 0u) << "the first of those that are equally near";
  EXPECT_EQ(novelty.samples[2].distance, 6);
  EXPECT_EQ(novelty.training[2].member, 1u);
  EXPECT_EQ(novelty.members_met, 3u);
}

TEST(Novelty, DoesNotDependOnTheOrder) {
  const RowMatrix training = random_rows(8, 5, 13), samples = random_rows(6, 5, 14);
  const std::vector<size_t> order = {5, 2, 7, 0, 1, 6, 3, 4};
  const RowMatrix shuffled = tests::in_order(training, order),
                  reversed = samples.colwise().reverse();
  const Novelty before =
      measure_novelty(rms_distances(samples, training, 5), rms_distances(training, training, 5));
  const Novelty after =
      measure_novelty(rms_distances(reversed, shuffled, 5), rms_distances(shuffled, shuffled, 5));
  EXPECT_NEAR(before.median_ratio, after.median_ratio, 1e-13);
  EXPECT_EQ(before.copy_share, after.copy_share);
  EXPECT_EQ(order[after.samples[5].member], before.samples[0].member);
  const std::vector<BlendShare> shares = measure_blends(samples, training),
                                of_shuffled = measure_blends(reversed, shuffled);
  ASSERT_EQ(shares.size(), 6u);
  for (size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(shares[k].median_residual, of_shuffled[k].median_residual, 1e-9);
}

TEST(Novelty, BlendsAreTheSameInAnyOrderOfPieces) {
  const RowMatrix training = random_rows(8, 5, 13), samples = random_rows(6, 5, 14);
  size_t pieces = 0;
  const auto backwards = [&](size_t count, const std::function<void(size_t)>& piece) {
    pieces = count;
    for (size_t i = count; i-- > 0;) piece(i);
  };
  const std::vector<BlendShare> shares = measure_blends(samples, training, 3),
                                of_pieces = measure_blends(samples, training, 3, backwards);
  EXPECT_EQ(pieces, 6u);
  ASSERT_EQ(shares.size(), of_pieces.size());
  for (size_t k = 0; k < shares.size(); ++k) {
    EXPECT_EQ(shares[k].residuals, of_pieces[k].residuals);
    EXPECT_NE(shares[k].residuals[0], shares[k].residuals[1]);
  }
}

TEST(Novelty, RefusesWhatSaysNothing) {
  const RowMatrix ones = RowMatrix::Ones(3, 3), none(0, 3);
  EXPECT_THROW(measure_novelty(none, ones), InputError);
  EXPECT_THROW(measure_novelty(RowMatrix::Ones(2, 4), ones), InputError);
  EXPECT_THROW(measure_novelty(RowMatrix::Ones(2, 1), RowMatrix::Ones(1, 1)), InputError)
      << "one member has no other";
  RowMatrix broken = ones;
  broken(1, 2) = std::nan("");
  EXPECT_THROW(measure_novelty(broken, ones), InputError);
  EXPECT_THROW(measure_novelty(ones, broken), InputError);
  EXPECT_THROW(measure_blends(none, ones), InputError);
  EXPECT_THROW(measure_blends(ones, RowMatrix::Ones(3, 2)), InputError);
  EXPECT_THROW(measure_blends(ones, RowMatrix::Ones(1, 3)), InputError);
  EXPECT_THROW(measure_blends(broken, ones), InputError);
}

}  // namespace
}  // namespace figurine::generation::novelty_test
