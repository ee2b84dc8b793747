// Asserts every bound that figurine-stability reports: one test a case, for the test programs that
// name the cases (INSTANTIATE_TEST_SUITE_P).
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <ostream>
#include <span>
#include <string>

#include "tests/stability/rows.h"

namespace figurine::stability {

inline void PrintTo(const Case& which, std::ostream* out) { *out << which.name; }

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

inline std::string name_of(const testing::TestParamInfo<Case>& info) { return info.param.name; }

inline auto values_in(std::span<const Case> cases) {
  return testing::ValuesIn(cases.begin(), cases.end());
}

}  // namespace figurine::stability
