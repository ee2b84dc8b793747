// The kernel distance of people who have several pictures each: against loops, and without the bias
// that pictures of one person have.
#include "toolchain/measure/kernel_distance.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/toolchain/measure/random_rows.h"
#include "toolchain/error.h"

namespace figurine::measure::kernel_comparison_test {
namespace {

using tests::random_rows;

double kernel_of(const RowVector& x, const RowVector& y) {
  return std::pow(x.dot(y) / double(x.size()) + 1, 3);
}

// Mean over pairs of pictures of different people, of two sets or of one.
double loops(const RowMatrix& a, const RowMatrix& b, Eigen::Index v, bool one_set) {
  double sum = 0, pairs = 0;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j < b.rows(); ++j) {
      if (one_set && i / v == j / v) continue;
      sum += kernel_of(a.row(i), b.row(j)), pairs += 1;
    }
  }
  return sum / pairs;
}

TEST(KernelComparison, IsWhatLoopsOverPicturesGive) {
  const RowMatrix a = random_rows(7 * 3, 5, 1), b = random_rows(4 * 3, 5, 2);
  const KernelComparison comparison(a, b, 3);
  const double expected = loops(a, a, 3, true) + loops(b, b, 3, true) - 2 * loops(a, b, 3, false);
  EXPECT_NEAR(comparison.distance(comparison.all()), expected, 1e-12 * std::abs(expected));
}

TEST(KernelComparison, OfOnePictureEachIsTheKernelDistance) {
  const RowMatrix a = random_rows(9, 4, 3), b = random_rows(6, 4, 4);
  const KernelComparison comparison(a, b, 1);
  EXPECT_NEAR(comparison.distance(comparison.all()), kernel_distance(a, b), 1e-12);
}

TEST(KernelComparison, ListsPeopleAsOftenAsTheyCountAndNeverAgainstThemselves) {
  const RowMatrix a = random_rows(4 * 2, 3, 5), b = random_rows(3 * 2, 3, 6);
  const KernelComparison comparison(a, b, 2);
  const double all = comparison.distance(comparison.all());
  EXPECT_NEAR(comparison.distance({{3, 1, 0, 2}, {2, 0, 1}}), all, 1e-12) << "in any order";
  RowMatrix pair(4, 3);
  pair << a.topRows(2), a.middleRows(4, 2);
  const KernelComparison of_two(pair, b, 2);
  EXPECT_NEAR(comparison.distance({{0, 2, 0, 2}, {0, 1, 2}}), of_two.distance(of_two.all()), 1e-12)
      << "copies are no pairs";
  EXPECT_TRUE(std::isnan(comparison.distance({{1, 1}, {0, 1, 2}})));
}

// Sets of one distribution: people far apart, pictures of one person alike. The estimate over
// people has mean 0, that over pictures has not.
TEST(KernelComparison, HasNoBiasWhereOnePersonsPicturesAreAlike) {
  constexpr Eigen::Index kPeople = 12, kPictures = 6, kTrials = 400;
  double people_sum = 0, people_squares = 0, pictures_sum = 0, pictures_squares = 0;
  for (Eigen::Index trial = 0; trial < kTrials; ++trial) {
    RowMatrix sets[2];
    for (Eigen::Index s = 0; s < 2; ++s) {
      const RowMatrix people = random_rows(kPeople, 4, 1000 + 2 * trial + s);
      sets[s] = 0.1 * random_rows(kPeople * kPictures, 4, 5000 + 2 * trial + s);
      for (Eigen::Index i = 0; i < sets[s].rows(); ++i) sets[s].row(i) += people.row(i / kPictures);
    }
    const KernelComparison comparison(sets[0], sets[1], kPictures);
    const double of_people = comparison.distance(comparison.all()),
                 of_pictures = kernel_distance(sets[0], sets[1]);
    people_sum += of_people, people_squares += of_people * of_people;
    pictures_sum += of_pictures, pictures_squares += of_pictures * of_pictures;
  }
  const auto error = [&](double sum, double squares) {
    return std::sqrt((squares - sum * sum / double(kTrials)) / double(kTrials - 1) /
                     double(kTrials));
  };
  const double people = people_sum / double(kTrials), pictures = pictures_sum / double(kTrials);
  const double people_error = error(people_sum, people_squares),
               pictures_error = error(pictures_sum, pictures_squares);
  std::printf("  over people %.3f +- %.3f, over pictures %.3f +- %.3f\n", people, people_error,
              pictures, pictures_error);
  EXPECT_LT(std::abs(people), 4 * people_error);
  EXPECT_GT(pictures, 4 * pictures_error) << "or the two could not be told apart";
}

TEST(KernelComparison, RefusesWhatIsNoSetOfPeople) {
  const RowMatrix six = random_rows(6, 3, 7);
  EXPECT_THROW(KernelComparison(six, six, 4), InputError) << "no whole person";
  EXPECT_THROW(KernelComparison(six, six, 6), InputError) << "one person";
  EXPECT_THROW(KernelComparison(six, six, 0), InputError);
  EXPECT_THROW(KernelComparison(six, random_rows(6, 2, 8), 2), InputError);
  RowMatrix broken = six;
  broken(1, 1) = NAN;
  EXPECT_THROW(KernelComparison(broken, six, 2), InputError);
}

}  // namespace
}  // namespace figurine::measure::kernel_comparison_test
