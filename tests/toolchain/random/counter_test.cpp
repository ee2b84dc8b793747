// Numbers by seed, stream and counter are uniform.
#include "toolchain/random/counter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::random {
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

}  // namespace
}  // namespace figurine::random
