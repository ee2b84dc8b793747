// The orders of the solvers, observed: on a Gaussian, whose flow is known exactly, and on the
// oracle of a few members, against Runge and Kutta's fourth order on the same equation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "runtime/src/sample/solver.h"
#include "tests/toolchain/generate/normal_rows.h"

namespace figurine::generate::solver_order_test {
namespace {

using tests::normal_rows;

constexpr size_t kSteps[] = {4, 8, 16, 32, 64, 128, 256};

template <class Oracle, class Real>
class OracleDenoiser : public Denoiser<Real> {
 public:
  explicit OracleDenoiser(const Oracle& oracle) : oracle_(&oracle) {}
  Status predict(std::span<const Real> z, const NoiseLevel& level, size_t,
                 std::span<Real> x0) override {
    const auto size = static_cast<Eigen::Index>(z.size());
    const RowVector wide = Eigen::Map<const Eigen::Matrix<Real, 1, Eigen::Dynamic>>(z.data(), size)
                               .template cast<double>();
    Eigen::Map<Eigen::Matrix<Real, 1, Eigen::Dynamic>>(x0.data(), size) =
        oracle_->predict(wide, level).template cast<Real>();
    return {};
  }

 private:
  const Oracle* oracle_;
};

template <class Real, class Oracle>
RowVector solved(const Oracle& oracle, const SolverOptions& options,
                 std::span<const NoiseLevel> levels, const RowVector& start) {
  const auto size = static_cast<size_t>(start.size());
  std::vector<Real> z(start.begin(), start.end()), x0(size), previous(size);
  OracleDenoiser<Oracle, Real> denoiser(oracle);
  const Status status = solve<Real>(options, levels, denoiser, {x0, previous}, z);
  EXPECT_TRUE(status.ok()) << status.message();
  return Eigen::Map<Eigen::Matrix<Real, 1, Eigen::Dynamic>>(z.data(), start.size())
      .template cast<double>();
}

std::vector<NoiseLevel> levels_of(const NoiseSchedule& schedule, size_t steps,
                                  bool pure_noise_start = false) {
  std::vector<NoiseLevel> levels(steps + 1);
  solver_levels(schedule, pure_noise_start, levels);
  return levels;
}

// d(z / sigma) / d lambda = e^lambda x0(z, lambda) by the classical method of the fourth order.
template <class Oracle>
RowVector runge_kutta(const Oracle& oracle, double from, double to, const RowVector& start,
                      int steps) {
  const double h = (to - from) / steps;
  const auto slope = [&](double lambda, const RowVector& y) -> RowVector {
    const NoiseLevel level = noise_level(lambda);
    return std::exp(lambda) * oracle.predict(level.sigma * y, level);
  };
  RowVector y = start / noise_level(from).sigma;
  for (int i = 0; i < steps; ++i) {
    const double lambda = from + i * h;
    const RowVector a = slope(lambda, y), b = slope(lambda + h / 2, y + h / 2 * a),
                    c = slope(lambda + h / 2, y + h / 2 * b), d = slope(lambda + h, y + h * c);
    y += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return noise_level(to).sigma * y;
}

// Root mean square errors over all starts, for each of kSteps.
template <class Real, class Oracle>
std::vector<double> errors_of(const Oracle& oracle, const SolverOptions& options,
                              const NoiseSchedule& schedule, const RowMatrix& starts,
                              const RowMatrix& truth) {
  std::vector<double> errors;
  for (const size_t steps : kSteps) {
    double sum = 0;
    for (Eigen::Index i = 0; i < starts.rows(); ++i) {
      sum +=
          (solved<Real>(oracle, options, levels_of(schedule, steps), starts.row(i)) - truth.row(i))
              .squaredNorm();
    }
    errors.push_back(std::sqrt(sum / double(starts.size())));
  }
  return errors;
}

// Of the last `halvings` halvings of the step, least squares in the logarithms.
double order_of(const std::vector<double>& errors, int halvings) {
  double numerator = 0, denominator = 0;
  for (int i = 0; i <= halvings; ++i) {
    const double x = i - halvings / 2.0;
    numerator += x * -std::log2(errors[errors.size() - 1 - size_t(halvings) + size_t(i)]);
    denominator += x * x;
  }
  return numerator / denominator;
}

struct Method {
  const char* name;
  SolverOptions options;
  double order;
};
const Method kMethods[] = {
    {"DDIM", {.method = SolverMethod::kDdim}, 1},
    {"DPM-Solver++(2M)", {.method = SolverMethod::kDpmSolverPlusPlus2M}, 2},
    {"DPM-Solver++(2M), last step of order 1",
     {.method = SolverMethod::kDpmSolverPlusPlus2M, .lower_order_final = true},
     2}};

void print_errors(const char* what, const char* method, const std::vector<double>& errors,
                  double order) {
  std::printf("%s, %s: rms error", what, method);
  for (size_t i = 0; i < errors.size(); ++i)
    std::printf(" %zu: %.3g%s", kSteps[i], errors[i], i + 1 < errors.size() ? "," : "");
  std::printf("; order %.2f\n", order);
}

GaussianOracle example_gaussian() {
  RowVector mean(8), variance(8);
  mean << 0, 1, -1, 0.5, 2, 0, -0.3, 0;
  variance << 1, 0.5, 0.1, 2, 1e-2, 0.25, 4, 1e-3;
  return {mean, variance};
}

TEST(SolverOrder, OfAGaussianIsTheStatedOne) {
  const GaussianOracle oracle = example_gaussian();
  const NoiseSchedule schedule = NoiseSchedule::create({.dimension = 156'000})
                                     .value();  // with the kink, after half of the steps
  const RowMatrix starts = normal_rows(16, 8, 1);
  RowMatrix truth(16, 8);
  for (Eigen::Index i = 0; i < 16; ++i)
    truth.row(i) = oracle.flow(starts.row(i), schedule.level(0), schedule.level(1));
  EXPECT_LT((runge_kutta(oracle, schedule.lambda(0), schedule.lambda(1), starts.row(0), 4000) -
             truth.row(0))
                .norm(),
            1e-9)
      << "the reference of the other test, against the exact flow";
  for (const Method& method : kMethods) {
    const std::vector<double> errors =
        errors_of<double>(oracle, method.options, schedule, starts, truth);
    const double order = order_of(errors, 3);
    print_errors("Gaussian", method.name, errors, order);
    EXPECT_NEAR(order, method.order, 0.15) << method.name;
  }
}

TEST(SolverOrder, OfTheMembersIsTheStatedOne) {
  const RowMatrix members = normal_rows(8, 32, 2), starts = normal_rows(12, 32, 3);
  const MemberOracle oracle(members);
  // Within the band, where samples are still between members, and at the clean end, where each is
  // its member and errors have shrunk.
  for (const double clean_snr : {30.0, 1e4}) {
    const NoiseSchedule schedule =
        NoiseSchedule::create({.dimension = 32, .clean_snr = clean_snr}).value();
    RowMatrix truth(starts.rows(), starts.cols());
    for (Eigen::Index i = 0; i < starts.rows(); ++i) {
      truth.row(i) =
          runge_kutta(oracle, schedule.lambda(0), schedule.lambda(1), starts.row(i), 4000);
    }
    for (const Method& method : kMethods) {
      const std::vector<double> errors =
          errors_of<double>(oracle, method.options, schedule, starts, truth);
      const double order = order_of(errors, 2);
      char what[64];
      std::snprintf(what, sizeof(what), "8 members, clean SNR %g", clean_snr);
      print_errors(what, method.name, errors, order);
      EXPECT_NEAR(order, method.order, 0.2) << method.name;
    }
  }
}

TEST(SolverOrder, InFloatReachesTheFloorOfFloat) {
  const GaussianOracle oracle = example_gaussian();
  const NoiseSchedule schedule = NoiseSchedule::create({.dimension = 156'000}).value();
  const RowMatrix starts = normal_rows(16, 8, 1);
  RowMatrix truth(16, 8);
  for (Eigen::Index i = 0; i < 16; ++i)
    truth.row(i) = oracle.flow(starts.row(i), schedule.level(0), schedule.level(1));
  double largest = 0;
  for (const Method& method : kMethods) {
    for (const size_t steps : kSteps) {
      for (Eigen::Index i = 0; i < 16; ++i) {
        const auto levels = levels_of(schedule, steps);
        const RowVector difference = solved<float>(oracle, method.options, levels, starts.row(i)) -
                                     solved<double>(oracle, method.options, levels, starts.row(i));
        largest = std::max(largest, difference.cwiseAbs().maxCoeff());
      }
    }
  }
  std::printf("largest difference of float from double over all methods and steps: %.3g\n",
              largest);
  EXPECT_LE(largest, 1e-5);
}

// From pure noise, whose first step is the prediction's alone, the sample is that of the exact
// flow, to what the gap to the first level costs.
TEST(SolverOrder, FromPureNoiseConverges) {
  const GaussianOracle oracle = example_gaussian();
  const NoiseSchedule schedule = NoiseSchedule::create({.dimension = 156'000}).value();
  const RowMatrix starts = normal_rows(16, 8, 4);
  for (const Method& method : kMethods) {
    std::vector<double> errors;
    for (const size_t steps : kSteps) {
      double sum = 0;
      for (Eigen::Index i = 0; i < 16; ++i) {
        const RowVector truth =
            oracle.flow(starts.row(i), noise_level(-INFINITY), schedule.level(1));
        sum += (solved<double>(oracle, method.options, levels_of(schedule, steps, true),
                               starts.row(i)) -
                truth)
                   .squaredNorm();
      }
      errors.push_back(std::sqrt(sum / double(starts.size())));
    }
    print_errors("Gaussian from pure noise", method.name, errors, order_of(errors, 3));
    EXPECT_LT(errors.back(), errors.front() / 20) << method.name;
  }
}

}  // namespace
}  // namespace figurine::generate::solver_order_test
