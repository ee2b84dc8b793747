// How unusual poses are, and what networks see in place of those that are far outside: against the
// definitions of docs/numerics.md in long double, with libm; and the same bits on every CPU.
#include "figurine/known_poses.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <vector>

#include "figurine/detail/philox.h"
#include "tests/largest_error.h"

namespace figurine::known_poses_test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();

using Rotations = std::vector<float>;  // [J,4]

// Numbers in [-1, 1), the same everywhere.
class Numbers {
 public:
  explicit Numbers(uint64_t seed) : seed_(seed) {}
  float next() { return static_cast<float>(stream_words(seed_, 7, at_++)[0] >> 8) * 0x1p-23f - 1; }

 private:
  uint64_t seed_, at_ = 0;
};

// Statistics of the joints with a covariance of random factors, and a table.
struct Sample {
  std::vector<float> mean, covariance, distances{1, 2, 3, 3, 5};
  PoseStatistics statistics;

  explicit Sample(std::vector<uint8_t> joints, uint64_t seed = 1) {
    const size_t n = 3 * joints.size();
    Numbers numbers(seed);
    std::vector<double> factor(n * n, 0);
    for (size_t i = 0; i < n; ++i) {
      mean.push_back(0.3f * numbers.next());
      for (size_t k = 0; k < i; ++k) factor[i * n + k] = 0.1 * double{numbers.next()};
      factor[i * n + i] = 0.15 + 0.1 * std::fabs(numbers.next());
    }
    if (joints[0] == 0) mean[1] = 0;  // a tilt has no turn about the vertical
    covariance.resize(n * n);
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j < n; ++j) {
        double sum = 0;
        for (size_t k = 0; k < n; ++k) sum += factor[i * n + k] * factor[j * n + k];
        covariance[i * n + j] = static_cast<float>(sum);
      }
    }
    statistics = {std::move(joints), mean, covariance, distances};
  }
  KnownPoses known() const { return std::move(KnownPoses::create(statistics)).value(); }
};

Rotations random_pose(size_t joints, uint64_t seed, float turn) {
  Numbers numbers(seed);
  Rotations rotations;
  for (size_t j = 0; j < joints; ++j) {
    const float sign = numbers.next() < 0 ? -1.0f : 1.0f, length = 1 + 0.5f * numbers.next();
    rotations.push_back(sign * length);
    for (int k = 0; k < 3; ++k) rotations.push_back(sign * length * turn * numbers.next());
  }
  return rotations;
}

using Vector = std::array<long double, 3>;
struct Turn {
  long double w, x, y, z;
};
Turn unit(const float* q) {
  long double length = 0;
  for (int k = 0; k < 4; ++k) length += static_cast<long double>(q[k]) * q[k];
  length = std::sqrt(length);
  return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}
Turn product(const Turn& a, const Turn& b) {
  return {
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
Vector vector_of(const Turn& q) {
  const long double sign = q.w < 0 ? -1 : 1, sine = std::hypot(q.x, q.y, q.z);
  if (sine == 0) return {0, 0, 0};
  const long double factor = sign * 2 * std::atan2(sine, sign * q.w) / sine;
  return {factor * q.x, factor * q.y, factor * q.z};
}
// With the turn about the vertical taken out: the rotation that takes the vertical where q does,
// from q's own right side.
Vector tilt_of(const Turn& q) {
  const long double length = std::hypot(q.w, q.y);
  return vector_of(product({q.w / length, 0, -q.y / length, 0}, q));
}

std::vector<long double> deviations(const Sample& sample, const Rotations& rotations) {
  std::vector<long double> x;
  for (const uint8_t joint : sample.statistics.joints) {
    const Turn q = unit(&rotations[4 * size_t{joint}]);
    for (const long double value : joint == 0 ? tilt_of(q) : vector_of(q)) x.push_back(value);
  }
  for (size_t i = 0; i < x.size(); ++i) x[i] -= sample.mean[i];
  return x;
}

// sqrt(x^T C^-1 x), the system solved by elimination with pivots.
long double oracle_distance(const Sample& sample, const Rotations& rotations) {
  const std::vector<long double> x = deviations(sample, rotations);
  const size_t n = x.size();
  std::vector<long double> a(sample.covariance.begin(), sample.covariance.end()), b = x;
  for (size_t c = 0; c < n; ++c) {
    size_t pivot = c;
    for (size_t r = c; r < n; ++r) {
      if (std::fabs(a[r * n + c]) > std::fabs(a[pivot * n + c])) pivot = r;
    }
    for (size_t k = 0; k < n; ++k) std::swap(a[c * n + k], a[pivot * n + k]);
    std::swap(b[c], b[pivot]);
    for (size_t r = 0; r < n; ++r) {
      if (r == c) continue;
      const long double factor = a[r * n + c] / a[c * n + c];
      for (size_t k = c; k < n; ++k) a[r * n + k] -= factor * a[c * n + k];
      b[r] -= factor * b[c];
    }
  }
  long double sum = 0;
  for (size_t i = 0; i < n; ++i) sum += x[i] * b[i] / a[i * n + i];
  return std::sqrt(sum);
}

TEST(RotationVector, IsTheAxisTimesTheAngle) {
  LargestError error("rotation vector, absolute");
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    const Rotations q = random_pose(1, seed, seed % 2 == 0 ? 1e-5f : 20.0f);
    const Vector truth = vector_of(unit(q.data()));
    const std::array<double, 3> seen = rotation_vector(q.data());
    for (size_t k = 0; k < 3; ++k) error.add(static_cast<double>(seen[k] - truth[k]));
  }
  EXPECT_LE(error.largest(), 2e-15);
  for (const float bad : {0.0f, kNan, kInfinity, -kInfinity, 1e-20f, 1e30f}) {
    const float q[4] = {bad, bad, 0, 0};
    for (const double value : rotation_vector(q)) EXPECT_EQ(value, 0) << bad;
  }
}

TEST(KnownPoses, DistanceIsMahalanobis) {
  LargestError error("distance, relative");
  for (const std::vector<uint8_t>& joints :
       {std::vector<uint8_t>{2}, {0}, {0, 1, 2}, {3, 0, 1, 2}}) {
    const Sample sample(joints, joints.size());
    const KnownPoses known = sample.known();
    for (uint64_t seed = 0; seed < 50; ++seed) {
      const Rotations pose = random_pose(4, 100 + seed, seed % 2 == 0 ? 0.3f : 3.0f);
      const long double truth = oracle_distance(sample, pose);
      error.add(static_cast<double>((known.distance(pose) - truth) / truth));
    }
  }
  EXPECT_LE(error.largest(), 1e-12);
}

TEST(KnownPoses, TheRootCountsByItsTilt) {
  const Sample sample({0, 1});
  const KnownPoses known = sample.known();
  LargestError error("distance under a turn, relative");
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Rotations pose = random_pose(2, seed, 1.0f);
    const double before = known.distance(pose);
    const Turn turned =
        product({std::cos(0.3L * seed), 0, std::sin(0.3L * seed), 0}, unit(pose.data()));
    pose[0] = static_cast<float>(turned.w), pose[1] = static_cast<float>(turned.x);
    pose[2] = static_cast<float>(turned.y), pose[3] = static_cast<float>(turned.z);
    error.add(known.distance(pose) / before - 1);
  }
  EXPECT_LE(error.largest(), 1e-6);  // the turned quaternion is rounded to float
  // Lying is not standing; on the head no heading can be told, and the numbers stay finite.
  const Rotations upright{1, 0, 0, 0, 1, 0, 0, 0}, lying{1, 1, 0, 0, 1, 0, 0, 0},
      on_the_head{0, 1, 0, 0, 1, 0, 0, 0};
  EXPECT_GT(known.distance(lying), known.distance(upright));
  EXPECT_GT(known.distance(on_the_head), known.distance(lying));
}

TEST(KnownPoses, TheShareIsThatOfTheTable) {
  // A joint that turns about one axis, deviation 1 a unit: the distance is the angle over 0.1.
  Sample sample({1});
  sample.mean = {0, 0, 0};
  sample.covariance = {0.01f, 0, 0, 0, 0.01f, 0, 0, 0, 0.01f};
  sample.statistics = {{1}, sample.mean, sample.covariance, sample.distances};
  const KnownPoses known = sample.known();
  const auto share = [&](double distance) {
    const double half = 0.05 * distance;
    const Rotations pose{
        1, 0, 0, 0, static_cast<float>(std::cos(half)), 0, static_cast<float>(std::sin(half)), 0};
    const PoseRarity rarity = known.rarity(pose);
    EXPECT_NEAR(rarity.distance, distance, 1e-4);
    return rarity.share_beyond;
  };
  // {1, 2, 3, 3, 5}: quarters of the training poses between.
  EXPECT_EQ(share(0), 1);
  EXPECT_EQ(share(0.99), 1);
  EXPECT_NEAR(share(1.5), 0.875, 1e-4);
  EXPECT_NEAR(share(2.5), 0.625, 1e-4);
  EXPECT_NEAR(share(2.999), 0.5, 1e-3);
  EXPECT_NEAR(share(3.001), 0.25, 1e-3);  // where two are alike, both are within
  EXPECT_NEAR(share(4), 0.125, 1e-4);
  EXPECT_EQ(share(5.01), 0);
  EXPECT_EQ(share(25), 0);
  for (const double wanted : {0.0, 0.05, 0.125, 0.6, 0.9, 1.0}) {
    const double distance = known.distance_beyond(wanted);
    if (wanted > 0 && wanted < 1) {
      EXPECT_NEAR(share(distance), wanted, 1e-4);
    }
  }
  EXPECT_EQ(known.distance_beyond(0), 5);
  EXPECT_EQ(known.distance_beyond(1), 1);
}

TEST(KnownPoses, InsideNothingIsWritten) {
  const Sample sample({1, 2});
  const KnownPoses known = sample.known();
  const double knee = known.distance_beyond(1 - kKnownShare);
  size_t inside = 0, outside = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Rotations pose = random_pose(3, seed, 0.05f + 0.01f * static_cast<float>(seed));
    Rotations pulled(pose.size(), 77.0f);
    const bool is_inside = known.distance(pose) <= knee;
    EXPECT_EQ(known.pull(pose, pulled), !is_inside);
    (is_inside ? inside : outside) += 1;
    if (is_inside) {
      EXPECT_EQ(pulled, Rotations(pose.size(), 77.0f));
    }
  }
  EXPECT_GT(inside, 10u);
  EXPECT_GT(outside, 10u);
}

TEST(KnownPoses, OutsideTheDeviationShrinksToTheKnee) {
  const Sample sample({0, 1, 3});
  const KnownPoses known = sample.known();
  const double a = known.distance_beyond(1 - kKnownShare), b = 5;
  LargestError of_distance("distance of the pulled pose, relative"),
      of_direction("its deviation beside the true one's"), of_heading("its heading");
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Rotations pose = random_pose(5, seed, 2.0f);
    Rotations pulled(pose.size());
    const double d = known.distance(pose);
    if (!known.pull(pose, pulled)) continue;
    const double t = (d - a) / (b - a), expected = a + (b - a) * t / (1 + t);
    of_distance.add(known.distance(pulled) / expected - 1);
    EXPECT_LT(known.distance(pulled), b * (1 + 1e-5));
    const std::vector<long double> before = deviations(sample, pose),
                                   after = deviations(sample, pulled);
    for (size_t i = 0; i < before.size(); ++i)
      of_direction.add(static_cast<double>(after[i] - before[i] * expected / d));
    // Joints that the statistics do not have keep their bits.
    for (const size_t joint : {size_t{2}, size_t{4}})
      EXPECT_EQ(std::memcmp(&pose[4 * joint], &pulled[4 * joint], 4 * sizeof(float)), 0);
    const auto heading = [](const Rotations& r) {
      return std::remainder(2 * std::atan2(double{r[2]}, double{r[0]}), 2 * std::numbers::pi);
    };
    of_heading.add(std::remainder(heading(pulled) - heading(pose), 2 * std::numbers::pi));
  }
  // Rounding of the quaternions to float, over deviations of 0.15 rad and more.
  EXPECT_LE(of_distance.largest(), 1e-6);
  EXPECT_LE(of_direction.largest(), 1e-6);
  EXPECT_LE(of_heading.largest(), 1e-6);
}

TEST(KnownPoses, ThePullHasNoStep) {
  const Sample sample({1});
  const KnownPoses known = sample.known();
  const double a = known.distance_beyond(1 - kKnownShare);
  // On the way out along one direction the pulled distance grows, by no more than the true one.
  double before = 0, before_pulled = 0;
  for (int step = 0; step < 2000; ++step) {
    const double half = 0.0007 * step;
    const Rotations pose{
        1, 0, 0, 0, static_cast<float>(std::cos(half)), static_cast<float>(std::sin(half)), 0, 0};
    Rotations pulled = pose;
    known.pull(pose, pulled);
    const double d = known.distance(pose), seen = known.distance(pulled);
    if (d > a && step > 0 && d > before) {
      EXPECT_GE(seen, before_pulled - 1e-5) << step;
      EXPECT_LE(seen - before_pulled, d - before + 1e-5) << step;
    }
    before = d, before_pulled = seen;
  }
}

TEST(KnownPoses, WhatIsNoRotationIsNone) {
  const Sample sample({0, 1, 2});
  const KnownPoses known = sample.known();
  const Rotations rest{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  for (const float bad : {0.0f, kNan, kInfinity, 1e-20f, 1e25f}) {
    for (size_t at = 0; at < rest.size(); ++at) {
      Rotations pose = rest;
      for (size_t k = 0; k < 4; ++k) pose[4 * (at / 4) + k] = k == at % 4 ? bad : 0;
      const PoseRarity rarity = known.rarity(pose);
      EXPECT_TRUE(std::isfinite(rarity.distance)) << bad << ", " << at;
      Rotations pulled(pose.size());
      if (!known.pull(pose, pulled)) continue;
      for (const float value : pulled) EXPECT_TRUE(std::isfinite(value)) << bad << ", " << at;
    }
  }
}

TEST(KnownPoses, OneTrainingPoseIsAllThereIs) {
  Sample sample({1});
  sample.distances = {0, 0};
  sample.statistics.distances = sample.distances;
  const KnownPoses known = sample.known();
  const Rotations pose{1, 0, 0, 0, 1, 0.5f, 0, 0};
  Rotations pulled(pose.size());
  EXPECT_EQ(known.rarity(pose).share_beyond, 0);
  ASSERT_TRUE(known.pull(pose, pulled));
  const std::array<double, 3> at = rotation_vector(&pulled[4]);
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(at[k], sample.mean[k], 1e-6);
}

TEST(KnownPoses, VariancesOfNothingStayFinite) {
  Sample sample({1, 2});
  for (float& value : sample.covariance) value = 0;
  for (size_t i = 0; i < 6; ++i) sample.covariance[7 * i] = 1e-37f;
  sample.statistics.covariance = sample.covariance;
  const KnownPoses known = sample.known();
  const Rotations pose = random_pose(3, 5, 2);
  Rotations pulled(pose.size());
  EXPECT_LE(known.distance(pose), 1e30);
  EXPECT_GT(known.distance(pose), 1e15);
  ASSERT_TRUE(known.pull(pose, pulled));
  for (const float value : pulled) EXPECT_TRUE(std::isfinite(value));
}

TEST(KnownPoses, RefusesWhatCannotBe) {
  const auto code = [](const PoseStatistics& statistics) {
    return KnownPoses::create(statistics).status().code();
  };
  Sample sample({1, 2});
  PoseStatistics none = sample.statistics;
  none.joints.clear();
  EXPECT_EQ(code(none), StatusCode::kInvalidArgument);
  PoseStatistics short_mean = sample.statistics;
  short_mean.mean = short_mean.mean.first(5);
  EXPECT_EQ(code(short_mean), StatusCode::kInvalidArgument);
  sample.covariance[0] = -1;
  EXPECT_EQ(code(sample.statistics), StatusCode::kCorrupt);
  for (const std::vector<float>& table : {std::vector<float>{1},
                                          {2, 1},
                                          {-1, 1},
                                          {0, kNan},
                                          {0, kInfinity},
                                          {0, 2e6f},
                                          std::vector<float>(kMaxPoseDistances + 1, 1)})
    EXPECT_EQ(validate_pose_distances(table).code(), StatusCode::kCorrupt) << table.size();
  const std::vector<float> flat(kMaxPoseDistances, 1);
  EXPECT_TRUE(validate_pose_distances(flat).ok());
}

// FNV-1a.
void add_bits(std::span<const float> values, uint64_t& hash) {
  for (const float value : values) {
    for (uint32_t bits = std::bit_cast<uint32_t>(value), k = 0; k < 4; ++k, bits >>= 8)
      hash = (hash ^ (bits & 255)) * 0x100000001b3u;
  }
}

TEST(KnownPoses, HaveTheSameBitsOnEveryCpu) {
  uint64_t hash = 0xcbf29ce484222325u;
  const Sample sample({0, 1, 2, 4, 5});
  const KnownPoses known = sample.known();
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const Rotations pose = random_pose(6, seed, 0.02f * static_cast<float>(seed));
    Rotations pulled = pose;
    known.pull(pose, pulled);
    const PoseRarity rarity = known.rarity(pose);
    const float values[] = {rarity.distance, rarity.share_beyond};
    add_bits(values, hash);
    add_bits(pulled, hash);
  }
  EXPECT_EQ(hash, 0xe3aa18593527a02fu);
}

}  // namespace
}  // namespace figurine::known_poses_test
