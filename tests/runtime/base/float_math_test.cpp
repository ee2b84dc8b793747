// The runtime's own exp, exp2, log2, erf and logistic against double libm, over dense samples of
// the floats of their domains.
#include "runtime/src/base/float_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace figurine::float_math_test {
namespace {

// Every stride-th float of [low, high], by bits; both ends of one sign. The stride is a prime, so
// that no mantissa pattern is favoured.
template <class Visit>
void for_each_float(float low, float high, uint32_t stride, const Visit& visit) {
  const uint32_t first = std::bit_cast<uint32_t>(std::fabs(low) < std::fabs(high) ? low : high);
  const uint32_t last = std::bit_cast<uint32_t>(std::fabs(low) < std::fabs(high) ? high : low);
  for (uint64_t bits = first; bits <= last; bits += stride)
    visit(std::bit_cast<float>(static_cast<uint32_t>(bits)));
  visit(std::bit_cast<float>(last));
}

struct Worst {
  double error = 0;
  float at = 0;
  void add(double e, float x) {
    if (!(std::fabs(e) <= error)) error = std::fabs(e), at = x;
  }
};

TEST(FloatMath, Exp2ErrorIsWithinItsStatement) {
  Worst worst;
  for_each_float(1e-10f, 125.0f, 331, [&](float x) {
    const double truth = std::exp2(-double(x));
    worst.add((exp2_minus(x) - truth) / truth, x);
  });
  std::printf("largest relative error of exp2: %.3g at %.9g\n", worst.error, worst.at);
  EXPECT_LE(worst.error, 1.1e-7);
  EXPECT_EQ(exp2_minus(0.0f), 1.0f);
  EXPECT_EQ(exp2_minus(1.0f), 0.5f);
  EXPECT_EQ(exp2_minus(126.0f), 0x1p-125f);
  EXPECT_EQ(exp2_minus(1e30f), 0x1p-125f);
  EXPECT_EQ(exp2_minus(INFINITY), 0x1p-125f);
}

TEST(FloatMath, Exp2OfANegativePowerNeverExceedsOne) {
  // Blending relies on it: opacity times the weight must not pass the opacity.
  for_each_float(1e-12f, 1.0f, 331, [](float x) { ASSERT_LE(exp2_minus(x), 1.0f) << x; });
}

TEST(FloatMath, ErfErrorIsWithinItsStatement) {
  Worst worst;
  const auto add = [&](float x) { worst.add(erf_float(x) - std::erf(double(x)), x); };
  for_each_float(-30.0f, -1e-20f, 331, add);
  for_each_float(1e-20f, 30.0f, 331, add);
  std::printf("largest error of erf: %.3g at %.9g\n", worst.error, worst.at);
  EXPECT_LE(worst.error, 6e-7);
  EXPECT_EQ(erf_float(30.0f), 1.0f);
  EXPECT_EQ(erf_float(-1e30f), -1.0f);
}

TEST(FloatMath, ExpErrorIsWithinItsStatement) {
  Worst worst;
  const auto add = [&](float x) {
    const double truth = std::exp(double(x));
    worst.add((exp_float(x) - truth) / truth, x);
  };
  for_each_float(-87.3f, -1e-10f, 331, add);
  for_each_float(1e-10f, 88.72f, 331, add);
  std::printf("largest relative error of exp: %.3g at %.9g\n", worst.error, worst.at);
  EXPECT_LE(worst.error, 1.3e-7);
  EXPECT_EQ(exp_float(0.0f), 1.0f);
  EXPECT_EQ(exp_float(-0.0f), 1.0f);
}

TEST(FloatMath, ExpHasTheRightLimits) {
  EXPECT_EQ(exp_float(-INFINITY), 0.0f);
  EXPECT_EQ(exp_float(-100.0f), 0.0f);
  EXPECT_EQ(exp_float(INFINITY), INFINITY);
  EXPECT_EQ(exp_float(89.0f), INFINITY);
  EXPECT_TRUE(std::isfinite(exp_float(88.72f)));
  EXPECT_TRUE(std::isnan(exp_float(NAN)));
}

TEST(FloatMath, LogisticIsWithinTwoUlpAndSaturates) {
  Worst worst;
  const auto add = [&](float x) {
    const double truth = 1 / (1 + std::exp(-double(x)));
    worst.add((logistic(x) - truth) / truth, x);
  };
  for_each_float(-80.0f, -1e-6f, 1009, add);
  for_each_float(1e-6f, 80.0f, 1009, add);
  std::printf("largest relative error of the logistic function: %.3g at %.9g\n", worst.error,
              worst.at);
  EXPECT_LE(worst.error, 2.4e-7);
  EXPECT_EQ(logistic(INFINITY), 1.0f);
  EXPECT_EQ(logistic(-INFINITY), 0.0f);
  EXPECT_EQ(logistic(-1000.0f), 0.0f);
  EXPECT_EQ(logistic(0.0f), 0.5f);
  EXPECT_TRUE(std::isnan(logistic(NAN)));
}

TEST(FloatMath, Log2ErrorIsWithinItsStatement) {
  Worst worst;
  const auto add = [&](float x) {
    const double truth = std::log2(double(x));
    worst.add((log2_float(x) - truth) / (2e-7 + 1.2e-7 * std::fabs(truth)), x);
  };
  for_each_float(0x1p-126f, 3e38f, 1009, add);
  std::printf("largest error of log2 as a part of its bound: %.3g at %.9g\n", worst.error,
              worst.at);
  EXPECT_LE(worst.error, 1);
  EXPECT_EQ(log2_float(1.0f), 0.0f);
  EXPECT_EQ(log2_float(8.0f), 3.0f);
}

}  // namespace
}  // namespace figurine::float_math_test
