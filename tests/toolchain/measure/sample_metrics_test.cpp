// MMD, COV and 1-NNA on sets small enough to be followed by hand, their identities, and their
// indifference to order.
#include "toolchain/measure/sample_metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"
#include "toolchain/measure/pooled_errors.h"

namespace figurine::measure::sample_metrics_test {
namespace {

RowMatrix apart(const RowMatrix& a, const RowMatrix& b) {
  RowMatrix distances(a.rows(), b.rows());
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j < b.rows(); ++j) distances(i, j) = (a.row(i) - b.row(j)).norm();
  }
  return distances;
}

SampleComparison compare(const RowMatrix& samples, const RowMatrix& references) {
  return SampleComparison(
      {apart(samples, references), apart(samples, samples), apart(references, references)});
}

RowMatrix on_a_line(std::initializer_list<double> places) {
  RowMatrix rows(Eigen::Index(places.size()), 1);
  std::copy(places.begin(), places.end(), rows.data());
  return rows;
}

std::string message_of(const SampleDistances& distances) {
  try {
    SampleComparison comparison(distances);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SampleMetrics, AreWhatAHandFinds) {
  // Samples 0, 1, 2.2 and references 1.5, 4, 9. Nearest samples are 0.7, 1.8 and 6.8 away. Every
  // sample's nearest reference is 1.5. Nearest neighbours: 0 -> 1 (right), 1 -> 1.5 (wrong), 2.2
  // -> 1.5 (wrong), 1.5 -> 1 (wrong), 4 -> 2.2 (wrong), 9 -> 4 (right).
  const SampleComparison comparison = compare(on_a_line({0, 1, 2.2}), on_a_line({1.5, 4, 9}));
  const SampleMetrics metrics = sample_metrics(comparison);
  EXPECT_NEAR(metrics.mmd, (0.5 + 1.8 + 6.8) / 3, 1e-15);
  EXPECT_NEAR(metrics.coverage_percent, 100.0 / 3, 1e-13);
  EXPECT_NEAR(metrics.one_nna_percent, 100.0 / 3, 1e-13);
  EXPECT_NEAR(metrics.one_nna_off_ideal, 50 - 100.0 / 3, 1e-13);
}

TEST(SampleMetrics, PsnrIsTakenAfterTheLeastErrorAndBeforeTheMean) {
  RowMatrix mse(2, 2), own = RowMatrix::Zero(2, 2);
  mse << 0.1, 0.5,  //
      0.2, 0.001;
  const SampleComparison comparison({mse, own, own});
  EXPECT_NEAR(comparison.mmd_psnr_db(comparison.all()), (10 + 30) / 2.0, 1e-13);
  EXPECT_NEAR(comparison.mmd(comparison.all()), 0.0505, 1e-16);
}

TEST(SampleMetrics, OfTheReferencesThemselvesArePerfectAndGiveThemAway) {
  const RowMatrix people = tests::random_rows(12, 5, 1);
  const SampleComparison comparison = compare(people, people);
  const SampleMetrics metrics = sample_metrics(comparison);
  EXPECT_EQ(metrics.mmd, 0);
  EXPECT_EQ(comparison.mmd_psnr_db(comparison.all()), INFINITY);
  EXPECT_EQ(metrics.coverage_percent, 100);
  EXPECT_EQ(metrics.one_nna_percent, 0)
      << "copies: every nearest neighbour stands in the other set";
  EXPECT_EQ(metrics.one_nna_off_ideal, 50);
}

TEST(SampleMetrics, AreAsGoodForReferencesThatContainTwins) {
  RowMatrix people = tests::random_rows(6, 3, 2);
  people.row(4) = people.row(1);
  const SampleComparison comparison = compare(people, people);
  EXPECT_EQ(comparison.coverage_percent(comparison.all()), 100) << "both twins are met";
  // Of a twin's three nearest, one is of its own set: four items count a third each.
  EXPECT_NEAR(comparison.one_nna_percent(comparison.all()), 100 * (4.0 / 3) / 12, 1e-13);
}

TEST(SampleMetrics, TellACollapsedGeneratorApart) {
  // All samples at one reference: it alone is met. The samples are each other's twins and each
  // other's and the reference's nearest.
  const RowMatrix references = tests::random_rows(8, 4, 3);
  const SampleComparison comparison = compare(references.row(2).replicate(8, 1), references);
  EXPECT_EQ(comparison.coverage_percent(comparison.all()), 12.5);
  // A sample has 7 equals among the samples and 1 among the references.
  double right = 8 * 7.0 / 8;
  const RowMatrix own = apart(references, references);
  for (Eigen::Index r = 0; r < 8; ++r) {
    if (r == 2) continue;
    double nearest = INFINITY;
    for (Eigen::Index other = 0; other < 8; ++other) {
      if (other != r) nearest = std::min(nearest, own(r, other));
    }
    // Where reference 2 is the nearest, eight samples stand there as well.
    right += nearest == own(r, 2) ? 1.0 / 9 : 1;
  }
  EXPECT_NEAR(comparison.one_nna_percent(comparison.all()), 100 * right / 16, 1e-12);
  const SampleComparison far = compare(tests::random_rows(8, 4, 4).array() + 1000, references);
  EXPECT_EQ(sample_metrics(far).one_nna_percent, 100);
}

TEST(SampleMetrics, AreIdealForSamplesOfTheSameDistribution) {
  double sum = 0;
  constexpr uint64_t kTrials = 40;
  for (uint64_t trial = 0; trial < kTrials; ++trial) {
    sum += sample_metrics(compare(tests::random_rows(60, 3, 100 + trial),
                                  tests::random_rows(60, 3, 200 + trial)))
               .one_nna_percent;
  }
  EXPECT_NEAR(sum / kTrials, 50,
              4 * 100 * 0.5 / std::sqrt(120.0 * kTrials) *
                  1.5);  // neighbours are not independent: half as much again
}

TEST(SampleMetrics, DoNotDependOnTheOrder) {
  RowMatrix samples = tests::random_rows(9, 2, 5), references = tests::random_rows(9, 2, 6);
  samples.row(3) = references.row(7);  // with ties
  samples.row(8) = samples.row(3);
  references.row(0) = references.row(7);
  const SampleMetrics before = sample_metrics(compare(samples, references));
  const SampleMetrics after =
      sample_metrics(compare(tests::in_order(samples, {8, 2, 0, 5, 7, 1, 3, 6, 4}),
                             tests::in_order(references, {3, 7, 1, 0, 2, 8, 6, 4, 5})));
  EXPECT_NEAR(before.mmd, after.mmd, 1e-15);
  EXPECT_EQ(before.coverage_percent, after.coverage_percent);
  EXPECT_NEAR(before.one_nna_percent, after.one_nna_percent, 1e-13);
}

TEST(SampleMetrics, NoItemIsItsOwnCopysNeighbour) {
  // Listed twice, every item still has the neighbours that it had: they are as many times there.
  const SampleComparison comparison =
      compare(tests::random_rows(7, 3, 8), tests::random_rows(7, 3, 9));
  Items twice = comparison.all();
  twice.samples.insert(twice.samples.end(), twice.samples.begin(), twice.samples.end());
  twice.references.insert(twice.references.end(), twice.references.begin(), twice.references.end());
  EXPECT_EQ(comparison.one_nna_percent(twice), comparison.one_nna_percent(comparison.all()));
  EXPECT_EQ(comparison.coverage_percent(twice), comparison.coverage_percent(comparison.all()));
  EXPECT_NEAR(comparison.mmd(twice), comparison.mmd(comparison.all()), 1e-15);
}

TEST(SampleMetrics, OfSomeItemsAreThoseOfTheirMatrices) {
  const RowMatrix samples = tests::random_rows(6, 3, 10), references = tests::random_rows(6, 3, 11);
  const SampleComparison all = compare(samples, references);
  const std::vector<size_t> some = {4, 0, 2}, others = {1, 5, 3};
  const SampleComparison part =
      compare(tests::in_order(samples, some), tests::in_order(references, others));
  EXPECT_DOUBLE_EQ(all.mmd({some, others}), part.mmd(part.all()));
  EXPECT_EQ(all.coverage_percent({some, others}), part.coverage_percent(part.all()));
  EXPECT_EQ(all.one_nna_percent({some, others}), part.one_nna_percent(part.all()));
}

TEST(SampleMetrics, DrawsAreDisjointAndInOrder) {
  const RowMatrix samples = tests::random_rows(8, 3, 12), references = tests::random_rows(3, 3, 13);
  const std::vector<SampleComparison> draws = disjoint_draws(
      {apart(samples, references), apart(samples, samples), apart(references, references)});
  ASSERT_EQ(draws.size(), 2u) << "two of eight are left over";
  for (Eigen::Index d = 0; d < 2; ++d) {
    const SampleMetrics found = sample_metrics(draws[size_t(d)]),
                        expected =
                            sample_metrics(compare(samples.middleRows(3 * d, 3), references));
    EXPECT_EQ(found.mmd, expected.mmd);
    EXPECT_EQ(found.coverage_percent, expected.coverage_percent);
    EXPECT_EQ(found.one_nna_percent, expected.one_nna_percent);
  }
  EXPECT_NE(sample_metrics(draws[0]).mmd, sample_metrics(draws[1]).mmd);
  EXPECT_THROW(disjoint_draws({apart(references, samples), apart(references, references),
                               apart(samples, samples)}),
               InputError)
      << "fewer samples than references";
  EXPECT_THROW(disjoint_draws({apart(samples, references), apart(references, references),
                               apart(references, references)}),
               InputError);
}

TEST(SampleMetrics, RefuseSetsThatSayNothing) {
  const RowMatrix two = RowMatrix::Ones(2, 2), none(0, 0);
  EXPECT_NE(message_of({none, none, none}).find("no samples"), std::string::npos);
  EXPECT_NE(message_of({RowMatrix::Ones(2, 3), two, RowMatrix::Ones(3, 3)})
                .find("2 samples and 3 references"),
            std::string::npos);
  EXPECT_NE(message_of({two, RowMatrix::Ones(3, 3), two}).find("do not fit"), std::string::npos);
  RowMatrix broken = two;
  broken(1, 0) = std::nan("");
  EXPECT_NE(
      message_of({broken, two, two}).find("distance 1, 0 of samples to references is not finite"),
      std::string::npos);
  broken(1, 0) = INFINITY;
  EXPECT_NE(message_of({two, two, broken}).find("of references is not finite"), std::string::npos);
  RowMatrix own = two;
  own(0, 0) = own(1, 1) = INFINITY;
  EXPECT_EQ(message_of({two, own, own}), "") << "nobody looks at the diagonal of a set with itself";
  EXPECT_NE(message_of({own, two, two}), "");
}

}  // namespace
}  // namespace figurine::measure::sample_metrics_test
