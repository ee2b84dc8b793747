// Numbers by seed, stream and counter are uniform.
#include "toolchain/random/counter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::random::counter_test {
namespace {

TEST(RandomUnit, IsUniformWithinSamplingError) {
  double sum = 0, squares = 0;
  constexpr int kCount = 100000;
  for (uint64_t i = 0; i < kCount; ++i) {
    const double value = random_unit(5, 1, i);
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 3, 0.005);
}

TEST(RandomNormal, HasTheMomentsOfANormal) {
  double sum = 0, squares = 0, fourths = 0;
  constexpr int kCount = 100000;
  for (uint64_t i = 0; i < kCount; ++i) {
    const double value = random_normal(5, 1, i);
    ASSERT_TRUE(std::isfinite(value));
    sum += value;
    squares += value * value;
    fourths += value * value * value * value;
  }
  // Five standard deviations of each mean: those of x, x^2 and x^4 are 1, sqrt(2) and sqrt(96).
  EXPECT_NEAR(sum / kCount, 0, 5 * std::sqrt(1.0 / kCount));
  EXPECT_NEAR(squares / kCount, 1, 5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(fourths / kCount, 3, 5 * std::sqrt(96.0 / kCount));
}

}  // namespace
}  // namespace figurine::random::counter_test
