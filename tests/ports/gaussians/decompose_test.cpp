// Scales and rotation from a covariance factor: closed form first, then random factors over all
// shapes.
#include "ports/gaussians/decompose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "largest_error.h"

namespace figurine::ports::decompose_test {
namespace {

using Matrix = std::array<double, 9>;

Matrix rotation_of(const std::array<double, 4>& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),  //
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

void expect_same_covariance(const std::array<float, 9>& factor, const ScaleRotation& shape,
                            LargestError& error) {
  const Matrix r = rotation_of(shape.quaternion);
  double largest = 0, covariance[9], again[9];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      covariance[3 * i + j] = again[3 * i + j] = 0;
      for (int k = 0; k < 3; ++k) {
        covariance[3 * i + j] += double(factor[3 * i + k]) * factor[3 * j + k];
        again[3 * i + j] += r[3 * i + k] * shape.scale[k] * shape.scale[k] * r[3 * j + k];
      }
      largest = std::max(largest, std::abs(covariance[3 * i + j]));
    }
  }
  for (int k = 0; k < 9; ++k) error.add((again[k] - covariance[k]) / std::max(largest, 1e-300));
}

TEST(Decompose, ADiagonalFactor) {
  const std::array<float, 9> factor{2, 0, 0, 0, 3, 0, 0, 0, 0.5f};
  const ScaleRotation shape = decompose(factor.data());
  EXPECT_DOUBLE_EQ(shape.scale[0], 3);
  EXPECT_DOUBLE_EQ(shape.scale[1], 2);
  EXPECT_DOUBLE_EQ(shape.scale[2], 0.5);
}

TEST(Decompose, RandomFactorsOfEveryShape) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  LargestError error("covariance from scales and rotation, relative"), length("quaternion length");
  for (int i = 0; i < 20000; ++i) {
    std::array<float, 9> factor;
    for (int k = 0; k < 9; ++k)
      factor[k] = normal(random) * std::pow(10.0f, static_cast<float>(k % 3 == 0 ? 0 : -(i % 7)));
    if (i % 2 == 1) {  // mirrored: the rotation must still be proper
      for (int r = 0; r < 3; ++r) std::swap(factor[3 * r], factor[3 * r + 1]);
    }
    const ScaleRotation shape = decompose(factor.data());
    expect_same_covariance(factor, shape, error);
    double length2 = 0;
    for (const double value : shape.quaternion) length2 += value * value;
    length.add(length2, 1);
    ASSERT_TRUE(shape.scale[0] >= shape.scale[1] && shape.scale[1] >= shape.scale[2] &&
                shape.scale[2] >= 0);
    ASSERT_GE(shape.quaternion[0], 0);
  }
  EXPECT_LE(error.largest(), 1e-13);
  EXPECT_LE(length.largest(), 1e-14);
}

// The small axis of a needle keeps its digits: the way through F F^T would have none left at 1:1e9.
TEST(Decompose, SmallAxesKeepTheirRelativeAccuracy) {
  const double angle = 0.7;
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  const float small =
      0x1p-30f;  // a power of two: the products below are exact, the columns orthogonal
  const std::array<float, 9> factor{c, -s * small, 0, s, c * small, 0, 0, 0, 1e-5f};
  const ScaleRotation shape = decompose(factor.data());
  const double length = std::hypot(double(c), double(s));
  EXPECT_NEAR(shape.scale[0] / length, 1, 1e-14);
  EXPECT_NEAR(shape.scale[1] / 1e-5f, 1, 1e-14);
  EXPECT_NEAR(shape.scale[2] / (small * length), 1, 1e-12);
}

TEST(Decompose, FlatAndPointlikeGaussians) {
  LargestError error("covariance of singular factors, relative");
  const std::array<float, 9> disc{1, 0, 0, 0, 1, 0, 0, 0, 0},
      needle{0, 0, 0, 0, 0, 0, 0.5f, 0.5f, 0}, tiny{1e-30f, 0, 0, 0, 1e-32f, 0, 0, 0, 1e-30f};
  for (const auto& factor : {disc, needle, tiny})
    expect_same_covariance(factor, decompose(factor.data()), error);
  EXPECT_LE(error.largest(), 1e-14);
  const std::array<float, 9> nothing{};
  const ScaleRotation point = decompose(nothing.data());
  EXPECT_EQ(point.scale[0], 0);
  EXPECT_EQ(point.quaternion[0], 1);
}

}  // namespace
}  // namespace figurine::ports::decompose_test
