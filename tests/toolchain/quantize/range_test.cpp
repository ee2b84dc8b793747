// Ranges from histograms, by hand where that is possible.
#include "toolchain/quantize/range.h"

#include <gtest/gtest.h>

#include <cmath>

#include "figurine/detail/fixed_point_weights.h"

namespace figurine::quantize::range_test {
namespace {

std::vector<float> ramp(size_t count, float high) {
  std::vector<float> values;
  for (size_t i = 0; i < count; ++i)
    values.push_back(high * (static_cast<float>(i) + 0.5f) / static_cast<float>(count));
  return values;
}

TEST(Histogram, FindsTheSameRangesInWhateverOrderLargerValuesCome) {
  const std::vector<float> small = ramp(10000, 0.37f), large = ramp(10000, 90.0f);
  Histogram rising, falling;
  rising.add(small), rising.add(large);
  falling.add(large), falling.add(small);
  EXPECT_EQ(rising.count(), 20000u);
  EXPECT_EQ(rising.min_max().high, falling.min_max().high);
  EXPECT_EQ(rising.percentile(99).high, falling.percentile(99).high);
  EXPECT_NEAR(rising.squared_error({0, 45}), falling.squared_error({0, 45}),
              1e-3);  // of 169: a value on a bin's edge may go either way
}

TEST(Histogram, PercentileLeavesItsShareOutside) {
  Histogram histogram;
  histogram.add(ramp(100000, 1.0f));
  for (double percent : {90.0, 99.0, 99.9}) {
    EXPECT_NEAR(histogram.percentile(percent).high, percent / 100, 3e-4)
        << percent;  // a bin is 1/4096
    EXPECT_EQ(histogram.percentile(percent).low, 0) << "no value is negative";
  }
}

TEST(Histogram, PercentileOfASignedDistributionCutsBothEnds) {
  Histogram histogram;
  std::vector<float> values = ramp(100000, 2.0f);
  for (float& value : values) value -= 1;
  histogram.add(values);
  EXPECT_NEAR(histogram.percentile(99).low, -0.98, 1e-3);
  EXPECT_NEAR(histogram.percentile(99).high, 0.98, 1e-3);
}

// Rounding a uniform value to steps of s is an error of s^2 / 12; nothing is clipped.
TEST(Histogram, SquaredErrorOfAUniformValueIsATwelfthOfTheStepSquared) {
  Histogram histogram;
  histogram.add(ramp(1000000, 1.0f));
  const double step = 1.0 / 255;
  EXPECT_NEAR(histogram.squared_error({0, 1}), step * step / 12, 0.02 * step * step / 12);
}

// N values rounded to steps of h / 255 and one clipped from 8 to h: N (h / 255)^2 / 12 + (8 - h)^2
// is smallest at h = 8 / (1 + N / 780,300).
TEST(Histogram, SmallestErrorKeepsAUniformRangeAndCutsALoneOutlier) {
  Histogram uniform, outlier;
  uniform.add(ramp(1000000, 1.0f));
  outlier.add(ramp(1000000, 1.0f));
  outlier.add(std::vector<float>{8.0f});
  EXPECT_GE(uniform.smallest_error().high, 0.98f);
  EXPECT_NEAR(outlier.smallest_error().high, 8 / (1 + 1000000 / 780300.0),
              0.16);  // candidates are 0.08 apart
}

TEST(Histogram, OfNothingIsTheEmptyRange) {
  const Histogram histogram;
  EXPECT_EQ(histogram.min_max().high, 0);
  EXPECT_EQ(histogram.smallest_error().high, 0);
  EXPECT_EQ(histogram.squared_error({0, 1}), 0);
}

TEST(QuantisationOf, AReluHasZeroPointMinus128AndScaleMaxOver255) {
  EXPECT_EQ(quantisation_of({0, 5.1f}), (Quantisation{5.1f / 255, -128}));
}

TEST(QuantisationOf, ASignedRangeHasZeroOnAStep) {
  const Quantisation quantisation = quantisation_of({-1, 3});
  EXPECT_EQ(quantisation.zero_point, -64);  // -128 + 255/4, rounded
  EXPECT_EQ(dequantise(quantise_int8(0, quantisation), quantisation), 0);
}

TEST(QuantisationOf, ADeadLayerHasAUsableScale) {
  EXPECT_GT(quantisation_of({0, 0}).scale, 0);
  EXPECT_EQ(quantise_int8(0, quantisation_of({0, 0})), -128);
}

TEST(WeightScale, MaxAbsReaches127) {
  const std::vector<float> weights{0.5f, -2.54f, 1.0f};
  EXPECT_FLOAT_EQ(max_abs_scale(weights), 0.02f);
  EXPECT_EQ(max_abs_scale(std::vector<float>{0, 0}), 0);
  EXPECT_EQ(smallest_error_scale(std::vector<float>{0, 0}), 0);
}

TEST(WeightScale, SmallestErrorIsNeverWorseThanMaxAbs) {
  std::vector<float> weights;
  for (int i = 0; i < 288; ++i) weights.push_back(std::sin(static_cast<float>(i * i)) * 0.3f);
  weights.push_back(1.1f);
  const auto error = [&](float scale) {
    double sum = 0;
    for (float weight : weights) {
      const double difference =
          weight - scale * static_cast<float>(clamp_and_round(weight / scale, -127, 127));
      sum += difference * difference;
    }
    return sum;
  };
  EXPECT_LE(error(smallest_error_scale(weights)), error(max_abs_scale(weights)));
  EXPECT_LE(smallest_error_scale(weights), max_abs_scale(weights));
}

}  // namespace
}  // namespace figurine::quantize::range_test
