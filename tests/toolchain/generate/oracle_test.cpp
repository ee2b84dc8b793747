// The closed-form denoisers against brute force in long double, and their limits.
#include "toolchain/generate/oracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/largest_error.h"
#include "tests/toolchain/generate/normal_rows.h"

namespace figurine::generate::oracle_test {
namespace {

using tests::normal_rows;

struct BruteForce {
  std::vector<long double> x0;
  long double entropy_nats = 0;
};

BruteForce brute_force(const RowMatrix& members, const RowVector& z, double lambda) {
  const long double alpha = 1 / std::sqrt(1 + std::exp(-2 * static_cast<long double>(lambda)));
  const long double variance = 1 / (1 + std::exp(2 * static_cast<long double>(lambda)));
  std::vector<long double> log_weight(size_t(members.rows()), 0);
  for (Eigen::Index n = 0; n < members.rows(); ++n) {
    for (Eigen::Index d = 0; d < z.size(); ++d) {
      const long double difference = z[d] - alpha * members(n, d);
      log_weight[size_t(n)] -= difference * difference / (2 * variance);
    }
  }
  const long double largest = *std::max_element(log_weight.begin(), log_weight.end());
  long double sum = 0;
  for (const long double value : log_weight) sum += std::exp(value - largest);
  BruteForce truth{std::vector<long double>(size_t(z.size()), 0), 0};
  for (Eigen::Index n = 0; n < members.rows(); ++n) {
    const long double log_p = log_weight[size_t(n)] - largest - std::log(sum), p = std::exp(log_p);
    if (p > 0) truth.entropy_nats -= p * log_p;
    for (Eigen::Index d = 0; d < z.size(); ++d) truth.x0[size_t(d)] += p * members(n, d);
  }
  return truth;
}

// A place on the way of a member to noise.
RowVector noised(const RowMatrix& members, const NoiseLevel& level, uint64_t seed) {
  return level.alpha * members.row(Eigen::Index(seed) % members.rows()) +
         level.sigma * normal_rows(1, members.cols(), seed + 1000).row(0);
}

TEST(MemberOracle, EqualsBruteForce) {
  LargestError x0_error("prediction of the member oracle"),
      entropy_error("posterior entropy in nats");
  for (const auto& [count, dimension] :
       std::initializer_list<std::pair<int, int>>{{1, 3}, {5, 2}, {20, 200}, {100, 2000}}) {
    const RowMatrix members = normal_rows(count, dimension, uint64_t(count));
    const MemberOracle oracle(members);
    for (double lambda = -12; lambda <= 12; lambda += 0.5) {
      const NoiseLevel level = noise_level(lambda);
      const RowVector z = noised(members, level, uint64_t(lambda + 12));
      const BruteForce truth = brute_force(members, z, lambda);
      const RowVector x0 = oracle.predict(z, level);
      for (Eigen::Index d = 0; d < x0.size(); ++d)
        x0_error.add(double(x0[d] - truth.x0[size_t(d)]));
      entropy_error.add(double(oracle.posterior(z, level).entropy_nats - truth.entropy_nats));
    }
  }
  EXPECT_LE(x0_error.largest(), 1e-10);
  EXPECT_LE(entropy_error.largest(), 1e-10);
}

TEST(MemberOracle, KnowsNothingAtTheNoisyEndAndAllAtTheCleanEnd) {
  constexpr int kMembers = 50, kDimension = 2000;
  const RowMatrix members = normal_rows(kMembers, kDimension, 3);
  const MemberOracle oracle(members);
  const NoiseSchedule schedule = NoiseSchedule::create({.dimension = kDimension}).value();
  for (const double u : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const NoiseLevel level = schedule.level(u);
    double entropy = 0;
    for (uint64_t seed = 0; seed < 50; ++seed)
      entropy += oracle.posterior(noised(members, level, seed), level).entropy_nats / 50;
    std::printf("u %.2f, D x SNR %9.3g: mean posterior entropy %.4f nats of %.4f\n", u,
                kDimension * snr(level), entropy, std::log(double(kMembers)));
    if (u == 0) {
      EXPECT_NEAR(entropy, std::log(double(kMembers)), 0.1);
    }
    if (u >= 0.5) {
      EXPECT_LT(entropy, 1e-6);
    }
  }
  const NoiseLevel noise = noise_level(-INFINITY), clean = noise_level(INFINITY);
  const RowVector z = normal_rows(1, kDimension, 9).row(0);
  EXPECT_NEAR(oracle.posterior(z, noise).entropy_nats, std::log(double(kMembers)), 1e-14);
  EXPECT_LT((oracle.predict(z, noise) - members.colwise().mean()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_EQ(oracle.posterior(members.row(7), clean).entropy_nats, 0);
  EXPECT_EQ(oracle.predict(members.row(7), clean), members.row(7));
}

TEST(MemberOracle, IsSoundAtEveryLevel) {
  RowMatrix members = normal_rows(4, 300, 4);
  members.row(3) = members.row(0);  // twins share what one of them had
  const MemberOracle oracle(members);
  for (const double lambda :
       {-double(INFINITY), -700.0, -400.0, -50.0, 0.0, 50.0, 400.0, 700.0, double(INFINITY)}) {
    const NoiseLevel level = noise_level(lambda);
    for (const double size : {0.0, 1.0, 1e6}) {
      const RowVector z = size * members.row(0);
      const Posterior posterior = oracle.posterior(z, level);
      EXPECT_NEAR(posterior.weights.sum(), 1, 1e-14) << lambda << " " << size;
      EXPECT_EQ(posterior.weights[0], posterior.weights[3]);
      EXPECT_TRUE(posterior.entropy_nats >= 0 && posterior.entropy_nats <= std::log(4.0) + 1e-14)
          << lambda << " " << size;
      EXPECT_TRUE(oracle.predict(z, level).allFinite()) << lambda << " " << size;
    }
  }
  EXPECT_NEAR(oracle.posterior(members.row(0), noise_level(INFINITY)).entropy_nats, std::log(2.0),
              1e-15);
}

TEST(GaussianOracle, FlowFollowsThePrediction) {
  // d(z / sigma) / d(alpha / sigma) = x0, by central differences.
  RowVector mean(4), variance(4), z(4);
  mean << 1, -2, 0, 0.5;
  variance << 0, 1e-3, 1, 9;
  z << 0.3, -1, 2, -0.7;
  const GaussianOracle oracle(mean, variance);
  LargestError error("change of z / sigma over x0");
  for (double lambda = -4; lambda <= 4; lambda += 0.25) {
    constexpr double kStep = 1e-4;
    const NoiseLevel here = noise_level(lambda), before = noise_level(lambda - kStep),
                     after = noise_level(lambda + kStep);
    const RowVector change =
        oracle.flow(z, here, after) / after.sigma - oracle.flow(z, here, before) / before.sigma;
    const RowVector slope = change / (after.alpha / after.sigma - before.alpha / before.sigma),
                    x0 = oracle.predict(z, here);
    for (Eigen::Index d = 0; d < 4; ++d) error.add((slope[d] - x0[d]) / (1 + std::abs(x0[d])));
  }
  EXPECT_LE(error.largest(), 1e-6);
}

TEST(GaussianOracle, IsSoundAtPureNoiseAndAtNoNoise) {
  RowVector mean(3), variance(3), z(3);
  mean << 1, -2, 3;
  variance << 0, 1, 4;
  z << 5, 6, 7;
  const GaussianOracle oracle(mean, variance);
  const NoiseLevel noise = noise_level(-INFINITY), clean = noise_level(INFINITY);
  EXPECT_EQ(oracle.predict(z, noise), mean);
  EXPECT_EQ(oracle.predict(z, clean), (RowVector(3) << 1, 6, 7).finished());
  EXPECT_EQ(oracle.flow(z, noise, clean), (RowVector(3) << 1, 4, 17).finished());
}

}  // namespace
}  // namespace figurine::generate::oracle_test
