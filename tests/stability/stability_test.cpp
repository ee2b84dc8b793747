// Asserts every bound that figurine-stability reports.
#include <gtest/gtest.h>

#include <cstdio>
#include <ostream>

#include "tests/stability/rows.h"

namespace figurine::stability {

static void PrintTo(const Case& which, std::ostream* out) { *out << which.name; }

namespace {

class Stability : public testing::TestWithParam<Case> {};

TEST_P(Stability, HoldsItsBounds) {
  const Rows rows = GetParam().run();
  ASSERT_FALSE(rows.empty());
  for (const Row& row : rows) {
    std::printf("%s: %s: %g (%s %g)\n", row.name.c_str(), row.measure.c_str(), row.value,
                row.bound == Bound::kAtLeast ? "at least" : "at most", row.limit);
    EXPECT_TRUE(row.ok()) << row.name << ": " << row.measure << ": " << row.value;
  }
}

std::string name_of(const testing::TestParamInfo<Case>& info) { return info.param.name; }

INSTANTIATE_TEST_SUITE_P(Splatter, Stability,
                         testing::ValuesIn(splat_cases().begin(), splat_cases().end()), name_of);
INSTANTIATE_TEST_SUITE_P(Pose, Stability,
                         testing::ValuesIn(pose_cases().begin(), pose_cases().end()), name_of);
INSTANTIATE_TEST_SUITE_P(FixedPoint, Stability,
                         testing::ValuesIn(fixed_point_cases().begin(), fixed_point_cases().end()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Sampling, Stability,
                         testing::ValuesIn(sampling_cases().begin(), sampling_cases().end()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Sampler, Stability,
                         testing::ValuesIn(sampler_cases().begin(), sampler_cases().end()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Package, Stability,
                         testing::ValuesIn(package_cases().begin(), package_cases().end()),
                         name_of);

}  // namespace
}  // namespace figurine::stability
