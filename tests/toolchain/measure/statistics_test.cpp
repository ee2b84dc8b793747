#include "toolchain/measure/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace figurine::measure::statistics_test {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

TEST(Statistics, SummariesLeaveOutWhatWasNotMeasured) {
  const double values[] = {1, kNothing, 3, 5};
  const Summary summary = summarise(values);
  EXPECT_EQ(summary.count, 3u);
  EXPECT_DOUBLE_EQ(summary.mean, 3);
  EXPECT_DOUBLE_EQ(summary.least, 1);
  EXPECT_DOUBLE_EQ(summary.greatest, 5);
  EXPECT_DOUBLE_EQ(summary.standard_deviation, std::sqrt(8.0 / 3));
  EXPECT_TRUE(std::isnan(summarise({}).mean));
}

TEST(Statistics, QuantilesLieBetweenNeighbours) {
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0.5), 2);
  EXPECT_DOUBLE_EQ(quantile({1, 2}, 0.25), 1.25);
  EXPECT_DOUBLE_EQ(quantile({1, 2}, 1), 2);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(Statistics, HistogramsCountEverything) {
  const double values[] = {0, 0.5, 1, 1.5, 2};
  EXPECT_EQ(histogram(values, 0, 2, 2), (std::vector<size_t>{2, 3}));
  EXPECT_EQ(histogram(values, 1, 1, 3), (std::vector<size_t>{5, 0, 0}));
}

TEST(Statistics, CorrelationsSeeLinesAndOrders) {
  const double x[] = {1, 2, 3, 4, kNothing}, line[] = {5, 3, 1, -1, 7},
               bent[] = {1, 10, 100, 1000, 3}, flat[] = {2, 2, 2, 2, 2};
  EXPECT_NEAR(pearson_correlation(x, line), -1, 1e-15);
  EXPECT_LT(pearson_correlation(x, bent), 0.9);
  EXPECT_NEAR(spearman_correlation(x, bent), 1, 1e-15);
  EXPECT_TRUE(std::isnan(pearson_correlation(x, flat)));
  const double tied[] = {1, 1, 2, 2, 0};
  EXPECT_NEAR(spearman_correlation(x, tied), 2 / std::sqrt(5.0), 1e-15);
}

}  // namespace
}  // namespace figurine::measure::statistics_test
