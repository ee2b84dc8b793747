// The project's own exp, expm1, log, sine and cosine in double against libm in long double, over
// dense samples of their domains.
#include "figurine/detail/double_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/emulated.h"
#include "tests/largest_error.h"

namespace figurine::double_math_test {
namespace {

constexpr int kSamples = tests::kEmulated ? 20'000 : 400'000;  // ARM's long double is software

// Places of [low, high] that no binary grid favours.
template <class Visit>
void for_each_place(double low, double high, const Visit& visit) {
  for (int i = 0; i <= kSamples; ++i)
    visit(low + (high - low) * (static_cast<double>(i) / kSamples));
}

// Both signs, 1e-12 to `high` in equal ratios.
template <class Visit>
void for_each_size(double high, const Visit& visit) {
  for_each_place(std::log(1e-12), std::log(high),
                 [&](double l) { visit(std::exp(l)), visit(-std::exp(l)); });
}

double relative(double value, long double truth) {
  return static_cast<double>((value - truth) / truth);
}

TEST(DoubleMath, ExpErrorIsWithinItsStatement) {
  LargestError error("exp, relative");
  const auto add = [&](double x) {
    error.add(relative(exp_double(x), std::exp(static_cast<long double>(x))));
  };
  for_each_place(-707.99, 709.78, add);
  for_each_size(50, add);
  EXPECT_LE(error.largest(), 2e-16);
}

TEST(DoubleMath, ExpHasTheRightLimits) {
  EXPECT_EQ(exp_double(0.0), 1.0);
  EXPECT_EQ(exp_double(-INFINITY), 0.0);
  EXPECT_EQ(exp_double(-709.0), 0.0);
  EXPECT_EQ(exp_double(INFINITY), INFINITY);
  EXPECT_EQ(exp_double(710.0), INFINITY);
  EXPECT_TRUE(std::isfinite(exp_double(709.78)));
  EXPECT_TRUE(std::isnan(exp_double(NAN)));
}

TEST(DoubleMath, Expm1ErrorIsWithinItsStatement) {
  LargestError error("expm1, relative");
  const auto add = [&](double x) {
    error.add(relative(expm1_double(x), std::expm1(static_cast<long double>(x))));
  };
  for_each_place(-1, 1, [&](double x) {
    if (x != 0) add(x);
  });
  for_each_size(50, add);
  EXPECT_LE(error.largest(), 5e-16);
  EXPECT_EQ(expm1_double(0.0), 0.0);
  EXPECT_EQ(expm1_double(-INFINITY), -1.0);
  EXPECT_EQ(expm1_double(INFINITY), INFINITY);
}

TEST(DoubleMath, LogErrorIsWithinItsStatement) {
  LargestError error("log, relative");
  const auto add = [&](double x) {
    error.add(relative(log_double(x), std::log(static_cast<long double>(x))));
  };
  for_each_place(-708, 709, [&](double l) { add(std::exp(l)); });
  for_each_place(0.5, 1.9999, [&](double x) {
    if (x != 1) add(x);
  });
  for_each_size(0.3, [&](double x) {
    if (1 + x != 1) add(1 + x);
  });
  EXPECT_LE(error.largest(), 2e-16);
  EXPECT_EQ(log_double(1.0), 0.0);
}

TEST(DoubleMath, SineAndCosineErrorsAreWithinTheirStatement) {
  LargestError error("sine and cosine, absolute");
  const long double turn = 2 * std::acos(-1.0L);
  for_each_place(0, 1, [&](double x) {
    const SineCosine value = sine_cosine_of_turns(x);
    error.add(static_cast<double>(value.sine - std::sin(turn * x)));
    error.add(static_cast<double>(value.cosine - std::cos(turn * x)));
  });
  EXPECT_LE(error.largest(), 2e-16);
  for (const double x : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    EXPECT_EQ(sine_cosine_of_turns(x).sine, std::round(std::sin(static_cast<double>(turn) * x)))
        << x;
    EXPECT_EQ(sine_cosine_of_turns(x).cosine, std::round(std::cos(static_cast<double>(turn) * x)))
        << x;
  }
}

TEST(DoubleMath, AngleErrorIsWithinItsStatement) {
  LargestError error("angle of a sine and a cosine, relative");
  for_each_place(0, 1, [&](double turns) {
    const double angle = std::numbers::pi / 2 * turns, size = 0.5 + turns;
    const double sine = size * std::sin(angle), cosine = std::fmax(0.0, size * std::cos(angle));
    if (sine > 0)
      error.add(
          relative(angle_of(sine, cosine), std::atan2(static_cast<long double>(sine), cosine)));
  });
  for_each_size(1, [&](double sine) {
    sine = std::fabs(sine);
    const double cosine = std::sqrt(1 - std::fmin(1.0, sine * sine));
    error.add(relative(angle_of(sine, cosine), std::atan2(static_cast<long double>(sine), cosine)));
  });
  EXPECT_LE(error.largest(), 8e-16);
  EXPECT_EQ(angle_of(0, 1), 0);
  EXPECT_NEAR(angle_of(1, 0), std::numbers::pi / 2, 3e-16);
}

}  // namespace
}  // namespace figurine::double_math_test
