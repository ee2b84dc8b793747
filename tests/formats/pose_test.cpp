// Properties of the pose arithmetic (formats/src/pose.cpp): degenerate quaternions, kinematics
// against a float64 recursion, blends far from rotations, normals against the inverse transpose in
// float64.
#include "figurine/pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/largest_error.h"

namespace figurine::pose_test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::array<float, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};

// Row-major 3x3 in float64, by the textbook formula of a unit quaternion.
std::array<double, 9> rotation64(const float* q) {
  const double n = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] + double(q[2]) * q[2] +
                             double(q[3]) * q[3]);
  const double w = q[0] / n, x = q[1] / n, y = q[2] / n, z = q[3] / n;
  return {
      w * w + x * x - y * y - z * z, 2 * (x * y - w * z),           2 * (x * z + w * y),
      2 * (x * y + w * z),           w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
      2 * (x * z - w * y),           2 * (y * z + w * x),           w * w - x * x - y * y + z * z};
}

std::array<double, 9> multiply64(const std::array<double, 9>& a, const std::array<double, 9>& b) {
  std::array<double, 9> c{};
  for (int i = 0; i < 9; ++i) {
    for (int k = 0; k < 3; ++k) c[i] += a[3 * (i / 3) + k] * b[3 * k + i % 3];
  }
  return c;
}

std::vector<float> random_quaternions(size_t count, std::mt19937& random) {
  std::normal_distribution<float> normal;
  std::vector<float> quaternions(4 * count);
  for (float& value : quaternions) value = normal(random);
  return quaternions;
}

TEST(QuaternionRotation, IsOrthonormalAndMatchesFloat64ForAnyLength) {
  std::mt19937 random(1);
  LargestError rotation_error("rotation against float64"), orthonormality("R R^T - I");
  for (float length : {1.0f, 1e-17f, 1e-6f, 1e6f, 1e17f}) {
    std::vector<float> quaternions = random_quaternions(200, random);
    for (size_t i = 0; i < 200; ++i) {
      float* q = &quaternions[4 * i];
      for (int k = 0; k < 4; ++k) q[k] *= length;
      const std::array<float, 9> r = rotation_from_quaternion(q);
      const std::array<double, 9> expected = rotation64(q);
      for (int k = 0; k < 9; ++k) {
        rotation_error.add(r[k], expected[k]);
        double dot = 0;
        for (int m = 0; m < 3; ++m) dot += double(r[3 * (k / 3) + m]) * r[3 * (k % 3) + m];
        orthonormality.add(dot, k / 3 == k % 3 ? 1 : 0);
      }
    }
  }
  EXPECT_LE(rotation_error.largest(), 6e-7);
  EXPECT_LE(orthonormality.largest(), 1.2e-6);
}

TEST(QuaternionRotation, ZeroTinyAndNotFiniteGiveTheIdentity) {
  const float cases[][4] = {
      {0, 0, 0, 0},          {1e-30f, 0, 0, -1e-30f}, {kNan, 0, 0, 1},         {1, 0, kInfinity, 0},
      {-kInfinity, 0, 0, 0}, {0, 1e-45f, 0, 0},       {kNan, kNan, kNan, kNan}};
  for (const auto& q : cases)
    EXPECT_EQ(rotation_from_quaternion(q), kIdentity)
        << q[0] << ' ' << q[1] << ' ' << q[2] << ' ' << q[3];
}

TEST(QuaternionRotation, OppositeSignsAreTheSameRotation) {
  std::mt19937 random(2);
  const std::vector<float> quaternions = random_quaternions(100, random);
  for (size_t i = 0; i < 100; ++i) {
    const float* q = &quaternions[4 * i];
    const float negated[4] = {-q[0], -q[1], -q[2], -q[3]};
    EXPECT_EQ(rotation_from_quaternion(q), rotation_from_quaternion(negated));
  }
}

TEST(QuaternionRotation, HalfTurnsAreExact) {
  const float x[4] = {0, 3, 0, 0}, y[4] = {0, 0, -0.5f, 0}, z[4] = {0, 0, 0, 1e-10f};
  EXPECT_EQ(rotation_from_quaternion(x), (std::array<float, 9>{1, 0, 0, 0, -1, 0, 0, 0, -1}));
  EXPECT_EQ(rotation_from_quaternion(y), (std::array<float, 9>{-1, 0, 0, 0, 1, 0, 0, 0, -1}));
  EXPECT_EQ(rotation_from_quaternion(z), (std::array<float, 9>{-1, 0, 0, 0, -1, 0, 0, 0, 1}));
}

TEST(ValidatePose, NamesTheJointOfABadRotation) {
  std::vector<float> rotations{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  const auto status_with = [&](float value) {
    std::vector<float> changed = rotations;
    changed[4] = value;
    return validate_pose({{0, 0, 0}, changed}, 3);
  };
  EXPECT_TRUE(validate_pose({{0, 0, 0}, rotations}, 3).ok());
  for (float bad : {0.0f, 1e-7f, kNan, kInfinity, -kInfinity, 1e20f}) {
    const Status status = status_with(bad);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << bad;
    EXPECT_NE(status.message().find("joint 1"), std::string::npos) << status.message();
  }
  EXPECT_TRUE(status_with(1e-5f).ok());
}

TEST(ValidatePose, RejectsWrongCountsAndRootsThatAreNotFinite) {
  const std::vector<float> rotations{1, 0, 0, 0, 1, 0, 0, 0};
  EXPECT_EQ(validate_pose({{0, 0, 0}, rotations}, 3).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(validate_pose({{0, 0, 0}, rotations}, 1).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(validate_pose({{0, kNan, 0}, rotations}, 2).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(validate_pose({{0, 0, kInfinity}, rotations}, 2).code(), StatusCode::kInvalidArgument);
}

// A chain with side branches, like a body's: 60 joints, the deepest at level 30.
struct RandomSkeleton {
  std::vector<int16_t> parents;
  std::vector<float> rest, rotations;
  std::array<float, 3> root{0.3f, -0.2f, 1.5f};
  explicit RandomSkeleton(uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> offset(-0.3f, 0.3f);
    for (int j = 0; j < 60; ++j) {
      parents.push_back(static_cast<int16_t>(j < 30 ? j - 1 : random() % static_cast<unsigned>(j)));
      for (int k = 0; k < 3; ++k)
        rest.push_back((j > 0 ? rest[size_t(3 * parents[j] + k)] : 1.0f) + offset(random));
    }
    rotations = random_quaternions(60, random);
  }
};

TEST(SkinningTransforms, FollowTheRecursionInFloat64) {
  LargestError rotation_error("rotation, 30 levels"), joint_error("joint position [m], 30 levels");
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const RandomSkeleton s(seed);
    std::vector<Affine> actual(60);
    skinning_transforms({s.parents, s.rest}, {s.root, s.rotations}, actual);
    std::vector<std::array<double, 9>> rotation(60);
    std::vector<std::array<double, 3>> position(60);
    for (size_t j = 0; j < 60; ++j) {
      rotation[j] = rotation64(&s.rotations[4 * j]);
      const int parent = s.parents[j];
      for (int i = 0; i < 3; ++i) position[j][i] = double(s.rest[3 * j + i]) + s.root[i];
      if (parent >= 0) {
        rotation[j] = multiply64(rotation[parent], rotation[j]);
        for (int i = 0; i < 3; ++i) {
          position[j][i] = position[parent][i];
          for (int k = 0; k < 3; ++k)
            position[j][i] += rotation[parent][3 * i + k] *
                              (double(s.rest[3 * j + k]) - s.rest[size_t(3 * parent + k)]);
        }
      }
      const std::array<float, 3> moved = transform_point(
          actual[j], &s.rest[3 * j]);  // B_j takes the joint's rest position to its place
      for (int i = 0; i < 3; ++i) joint_error.add(moved[i], position[j][i]);
      for (int i = 0; i < 9; ++i)
        rotation_error.add(actual[j].m[4 * (i / 3) + i % 3], rotation[j][i]);
    }
  }
  // Errors add up along the chain: 30 products of a few roundings each; the positions carry them
  // over bones of 0.3 m.
  EXPECT_LE(rotation_error.largest(), 5e-6);
  EXPECT_LE(joint_error.largest(), 5e-6);
}

TEST(SkinningTransforms, RestPoseIsTheIdentity) {
  RandomSkeleton s(3);
  for (size_t i = 0; i < s.rotations.size(); ++i) s.rotations[i] = i % 4 == 0 ? 1.0f : 0.0f;
  std::vector<Affine> transforms(60);
  skinning_transforms({s.parents, s.rest}, {{0, 0, 0}, s.rotations}, transforms);
  LargestError error("rest pose");
  const Affine identity;
  for (const Affine& transform : transforms) {
    for (int i = 0; i < 12; ++i) error.add(transform.m[i], identity.m[i]);
  }
  EXPECT_LE(error.largest(),
            5e-7);  // a bone is a difference of near numbers: exact, or off by a rounding
}

TEST(Blend, OfOneTransformIsThatTransformAndUnusedSlotsAreNotRead) {
  Affine moved;
  moved.m = {0, -1, 0, 0.5f, 1, 0, 0, -2, 0, 0, 1, 7};
  Affine poison;
  poison.m.fill(kNan);
  const std::vector<Affine> transforms{moved, poison};
  const uint8_t joints[kSkinInfluences] = {0, 1, 1, 1, 1, 1, 1, 1};
  const float weights[kSkinInfluences] = {1, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(blend(transforms, joints, weights).m, moved.m);
}

TEST(Blend, ATwistOf180DegreesCollapsesToTheAxisAndStaysFinite) {
  // The known fault of linear blend skinning: half of a turn about x against none leaves only the x
  // axis ("candy wrapper").
  Affine turned;
  turned.m = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0};
  const std::vector<Affine> transforms{Affine{}, turned};
  const uint8_t joints[kSkinInfluences] = {0, 1};
  const float weights[kSkinInfluences] = {0.5f, 0.5f};
  const Affine blended = blend(transforms, joints, weights);
  EXPECT_EQ(blended.m, (std::array<float, 12>{1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  const float across[3] = {0, 1, 0}, along[3] = {1, 0, 0};
  EXPECT_EQ(transform_normal(blended, across),
            (std::array<float, 3>{0, 0, 0}));  // no direction is left: zero, not NaN
  EXPECT_EQ(transform_normal(blended, along), (std::array<float, 3>{0, 0, 0}));
}

// Unit normal of A^-T n in float64, by Gauss-Jordan.
std::array<double, 3> normal64(const Affine& transform, const float* normal) {
  double rows[3][4];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) rows[i][k] = transform.m[4 * k + i];  // A^T y = n
    rows[i][3] = normal[i];
  }
  for (int column = 0; column < 3; ++column) {
    int pivot = column;
    for (int i = column + 1; i < 3; ++i) {
      if (std::abs(rows[i][column]) > std::abs(rows[pivot][column])) pivot = i;
    }
    std::swap(rows[column], rows[pivot]);
    for (int i = 0; i < 3; ++i) {
      if (i == column) continue;
      const double factor = rows[i][column] / rows[column][column];
      for (int k = 0; k < 4; ++k) rows[i][k] -= factor * rows[column][k];
    }
  }
  std::array<double, 3> result;
  double length = 0;
  for (int i = 0; i < 3; ++i) {
    result[i] = rows[i][3] / rows[i][i];
    length += result[i] * result[i];
  }
  for (double& value : result) value /= std::sqrt(length);
  return result;
}

TEST(TransformNormal, EqualsTheInverseTransposeInFloat64) {
  std::mt19937 random(4);
  std::normal_distribution<float> normal;
  LargestError error("normal, far from singular");
  int tried = 0;
  while (tried < 2000) {
    Affine a;
    for (float& value : a.m) value = normal(random);
    float n[3] = {normal(random), normal(random), normal(random)};
    const double determinant = a.m[0] * (double(a.m[5]) * a.m[10] - double(a.m[6]) * a.m[9]) -
                               a.m[1] * (double(a.m[4]) * a.m[10] - double(a.m[6]) * a.m[8]) +
                               a.m[2] * (double(a.m[4]) * a.m[9] - double(a.m[5]) * a.m[8]);
    if (std::abs(determinant) < 0.1) continue;  // entries near 1: far from singular
    ++tried;
    const std::array<double, 3> expected = normal64(a, n);
    const std::array<float, 3> actual = transform_normal(a, n);
    for (int k = 0; k < 3; ++k) error.add(actual[k], expected[k]);
  }
  EXPECT_LE(error.largest(), 4e-6);
}

TEST(TransformNormal, AMirroredBlendDoesNotFlipTheNormal) {
  Affine mirrored;
  mirrored.m = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  const float n[3] = {0.6f, 0.8f, 0};
  const std::array<float, 3> result = transform_normal(mirrored, n);
  EXPECT_FLOAT_EQ(result[0], -0.6f);  // A^-T n, not its opposite
  EXPECT_FLOAT_EQ(result[1], 0.8f);
}

TEST(TransformNormal, NearlySingularBlendsGiveUnitLengthOrZero) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 2000; ++i) {
    Affine a;
    for (float& value : a.m) value = normal(random);
    const float squeeze = std::pow(10.0f, -float(i % 12));
    for (int k = 0; k < 3; ++k)
      a.m[8 + k] = a.m[k] + squeeze * a.m[8 + k];  // third row almost the first
    const float n[3] = {normal(random), normal(random), normal(random)};
    const std::array<float, 3> result = transform_normal(a, n);
    const double length = std::sqrt(double(result[0]) * result[0] + double(result[1]) * result[1] +
                                    double(result[2]) * result[2]);
    EXPECT_TRUE(length == 0 || std::abs(length - 1) < 1e-6) << length;
  }
}

}  // namespace
}  // namespace figurine::pose_test
