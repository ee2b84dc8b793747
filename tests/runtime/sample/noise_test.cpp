// The random numbers: published answers of the generator, moments and distribution of the normal
// values, and their bits.
#include "runtime/src/sample/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/largest_error.h"

namespace figurine::noise_test {
namespace {

using Words = std::array<uint32_t, 4>;

// Random123, kat_vectors, "philox4x32 10".
TEST(Philox, GivesThePublishedAnswers) {
  constexpr uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox4x32_10({0, 0, 0, 0}, {0, 0}),
            (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox4x32_10({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(
      philox4x32_10({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
      (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(BoxMuller, AgreesWithLibm) {
  LargestError error("normal values in double, absolute");
  for (uint32_t i = 0; i < 200'000; ++i) {
    const Words words = philox4x32_10({i, 0, 0, 0}, {1, 2});
    const std::array<double, 2> value = box_muller(words[0], words[1]);
    const long double radius = std::sqrt(-2 * std::log((words[0] + 0.5L) / 0x1p32L)),
                      turn = 2 * std::acos(-1.0L);
    const long double angle = turn * ((words[1] + 0.5L) / 0x1p32L);
    error.add(static_cast<double>(value[0] - radius * std::cos(angle)));
    error.add(static_cast<double>(value[1] - radius * std::sin(angle)));
  }
  EXPECT_LE(error.largest(), 3e-15);
}

TEST(BoxMuller, IsFiniteForTheExtremeWords) {
  constexpr uint32_t kWords[] = {0,          1,          0x3fffffff, 0x40000000, 0x7fffffff,
                                 0x80000000, 0xbfffffff, 0xc0000000, 0xfffffffe, 0xffffffff};
  double largest = 0;
  for (const uint32_t radius : kWords) {
    for (const uint32_t angle : kWords) {
      for (const double value : box_muller(radius, angle)) {
        ASSERT_TRUE(std::isfinite(value)) << radius << " " << angle;
        largest = std::max(largest, std::abs(value));
      }
    }
  }
  std::printf("largest normal value that there is: %.6f\n", largest);
  EXPECT_NEAR(largest, std::sqrt(2 * std::log(0x1p33)), 1e-9);
}

TEST(FillNormal, HasTheMomentsOfANormalDistribution) {
  constexpr size_t kCount = 4'000'000;
  std::vector<float> values(kCount);
  fill_normal(20, 1, values);
  double sum[5] = {};
  for (const float value : values) {
    double power = 1;
    for (int k = 1; k <= 4; ++k) sum[k] += power *= value;
  }
  const double n = kCount, mean = sum[1] / n, variance = sum[2] / n - mean * mean,
               third = sum[3] / n, fourth = sum[4] / n;
  std::printf("mean %.2g, variance %.5f, third moment %.2g, fourth moment %.5f\n", mean, variance,
              third, fourth);
  // Four standard deviations of each: their variances are 1, 2, 15 and 96 over n.
  EXPECT_LE(std::abs(mean), 4 * std::sqrt(1 / n));
  EXPECT_LE(std::abs(variance - 1), 4 * std::sqrt(2 / n));
  EXPECT_LE(std::abs(third), 4 * std::sqrt(15 / n));
  EXPECT_LE(std::abs(fourth - 3), 4 * std::sqrt(96 / n));
}

TEST(FillNormal, HasTheDistributionFunctionOfANormalDistribution) {
  constexpr size_t kCount = 1'000'000;
  std::vector<float> values(kCount);
  fill_normal(21, 0, values);
  std::sort(values.begin(), values.end());
  double largest = 0;
  for (size_t i = 0; i < kCount; ++i) {
    const double phi = 0.5 * std::erfc(-double(values[i]) / std::sqrt(2.0)), n = kCount;
    largest = std::max({largest, std::abs(phi - double(i) / n), std::abs(phi - double(i + 1) / n)});
  }
  const double scaled = largest * std::sqrt(double(kCount));
  std::printf("Kolmogorov-Smirnov: sqrt(n) D = %.3f\n", scaled);
  EXPECT_LE(scaled, 1.95);  // 0.1 % of sound generators would exceed it
}

TEST(FillNormal, NeighboursStreamsAndSeedsAreUncorrelated) {
  constexpr size_t kCount = 1'000'000;
  std::vector<float> a(kCount + 4), b(kCount + 4), c(kCount + 4);
  fill_normal(22, 0, a);
  fill_normal(22, 1, b);
  fill_normal(23, 0, c);
  const auto correlation = [&](const float* x, const float* y) {
    double sum = 0;
    for (size_t i = 0; i < kCount; ++i) sum += double(x[i]) * y[i];
    return std::abs(sum / kCount);
  };
  const double limit = 4 / std::sqrt(double(kCount));
  for (size_t lag = 1; lag <= 4; ++lag)
    EXPECT_LE(correlation(a.data(), a.data() + lag), limit) << lag;
  EXPECT_LE(correlation(a.data(), b.data()), limit);
  EXPECT_LE(correlation(a.data(), c.data()), limit);
}

TEST(FillNormal, AValueDependsOnItsPlaceAlone) {
  std::vector<float> whole(103), part(103);
  fill_normal(5, 6, whole);
  for (size_t first = 0; first < 9; ++first) {
    for (size_t count = 0; count < 9; ++count) {
      std::fill(part.begin(), part.end(), 0.0f);
      fill_normal(5, 6, std::span(part).first(count), first);
      for (size_t i = 0; i < count; ++i)
        ASSERT_EQ(std::bit_cast<uint32_t>(part[i]), std::bit_cast<uint32_t>(whole[first + i]))
            << first << i;
    }
  }
  // Far places and both halves of every 64-bit number count.
  float far[4];
  for (const auto& [seed, stream, first] :
       std::initializer_list<std::array<uint64_t, 3>>{{5, 6, uint64_t{1} << 34},
                                                      {5, 6 + (uint64_t{1} << 32), 0},
                                                      {5 + (uint64_t{1} << 32), 6, 0}}) {
    fill_normal(seed, stream, far, first);
    EXPECT_NE(far[0], whole[0]);
  }
}

TEST(FillNormal, HasTheSameBitsOnEveryCpu) {
  float values[8];
  fill_normal(20261126, 7, values);
  const float golden[8] = {0x1.83c094p-3f, -0x1.04931ep+0f, 0x1.7eeb02p-2f,  0x1.44aa7ep-2f,
                           0x1.f36722p-3f, -0x1.e1143cp+0f, -0x1.69bdaap+0f, -0x1.317128p-1f};
  for (size_t i = 0; i < 8; ++i)
    EXPECT_EQ(std::bit_cast<uint32_t>(values[i]), std::bit_cast<uint32_t>(golden[i])) << i;
}

}  // namespace
}  // namespace figurine::noise_test
