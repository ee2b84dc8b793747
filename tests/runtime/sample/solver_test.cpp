// The solvers' contracts: steps followed by hand, every number of steps finite, pure noise, the
// clean end, errors. Their orders are observed in tests/toolchain/generate.
#include "runtime/src/sample/solver.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <vector>

#include "runtime/src/sample/noise.h"

namespace figurine::solver_test {
namespace {

constexpr SolverMethod kMethods[] = {SolverMethod::kDdim, SolverMethod::kDpmSolverPlusPlus2M};

template <class Real>
class Given : public Denoiser<Real> {
 public:
  using Function =
      std::function<Status(std::span<const Real>, const NoiseLevel&, size_t, std::span<Real>)>;
  explicit Given(Function function) : function_(std::move(function)) {}
  Status predict(std::span<const Real> z, const NoiseLevel& level, size_t evaluation,
                 std::span<Real> x0) override {
    return function_(z, level, evaluation, x0);
  }

 private:
  Function function_;
};

// Of one standard normal value times `deviation`.
template <class Real>
Given<Real> gaussian(double deviation) {
  return Given<Real>([deviation](std::span<const Real> z, const NoiseLevel& level, size_t,
                                 std::span<Real> x0) {
    const double variance = deviation * deviation;
    const double factor =
        level.alpha * variance / (level.alpha * level.alpha * variance + level.sigma * level.sigma);
    for (size_t i = 0; i < z.size(); ++i) x0[i] = static_cast<Real>(factor * z[i]);
    return Status();
  });
}

Given<double> constant(double value) {
  return Given<double>(
      [value](std::span<const double>, const NoiseLevel&, size_t, std::span<double> x0) {
        for (double& x : x0) x = value;
        return Status();
      });
}

template <class Real>
struct Sampled {
  std::vector<Real> z, x0, previous_x0;
  Status status;

  Sampled(const SolverOptions& options, std::span<const NoiseLevel> levels,
          Denoiser<Real>& denoiser, std::vector<Real> start, SolverTrace<Real>* trace = nullptr)
      : z(std::move(start)),
        x0(z.size(), NAN),
        previous_x0(z.size(), NAN) {  // storage may hold anything
    status = solve<Real>(options, levels, denoiser, {x0, previous_x0}, z, trace);
  }
};

std::vector<NoiseLevel> levels_of(uint64_t dimension, size_t steps, bool pure_noise_start) {
  std::vector<NoiseLevel> levels(steps + 1);
  solver_levels(NoiseSchedule::create({.dimension = dimension}).value(), pure_noise_start, levels);
  return levels;
}

TEST(Solver, TakesTheStepsOfTheEquations) {
  // Predictions 1, 3, -2, whatever z is.
  const double predictions[] = {1, 3, -2};
  Given<double> denoiser(
      [&](std::span<const double>, const NoiseLevel&, size_t evaluation, std::span<double> x0) {
        x0[0] = predictions[evaluation];
        return Status();
      });
  const NoiseLevel levels[] = {noise_level(-2), noise_level(-1.5), noise_level(0), noise_level(2)};
  for (const SolverMethod method : kMethods) {
    for (const bool lower_order_final : {false, true}) {
      const Sampled<double> run({method, lower_order_final}, levels, denoiser, {0.7});
      ASSERT_TRUE(run.status.ok()) << run.status.message();
      double z = 0.7;
      for (size_t i = 0; i < 3; ++i) {
        const double h = levels[i + 1].lambda - levels[i].lambda;
        double x0 = predictions[i];
        if (method == SolverMethod::kDpmSolverPlusPlus2M && i > 0 &&
            !(lower_order_final && i == 2)) {
          const double r = (levels[i].lambda - levels[i - 1].lambda) / h;
          x0 = (1 + 1 / (2 * r)) * predictions[i] - 1 / (2 * r) * predictions[i - 1];
        }
        z = levels[i + 1].sigma / levels[i].sigma * z -
            levels[i + 1].alpha * (std::exp(-h) - 1) * x0;
      }
      EXPECT_NEAR(run.z[0], z, 1e-14);
    }
  }
}

TEST(Solver, AConstantPredictionIsFollowedExactlyByAnySteps) {
  Given<double> denoiser = constant(0.25);
  for (const SolverMethod method : kMethods) {
    for (const size_t steps : {1, 2, 3, 10, 1000}) {
      const std::vector<NoiseLevel> levels = levels_of(1000, steps, false);
      const Sampled<double> run({method}, levels, denoiser, {-1.5});
      ASSERT_TRUE(run.status.ok()) << run.status.message();
      const double noise = (-1.5 - levels.front().alpha * 0.25) / levels.front().sigma;
      EXPECT_NEAR(run.z[0], levels.back().alpha * 0.25 + levels.back().sigma * noise, 1e-13)
          << steps;
    }
  }
}

TEST(Solver, TheFirstStepFromPureNoiseIsThePredictionsAlone) {
  Given<double> denoiser = constant(3);
  const std::vector<NoiseLevel> levels = {noise_level(-INFINITY), noise_level(-1)};
  for (const SolverMethod method : kMethods) {
    const Sampled<double> run({method}, levels, denoiser, {0.5});
    ASSERT_TRUE(run.status.ok()) << run.status.message();
    EXPECT_EQ(run.z[0], levels[1].sigma * 0.5 + levels[1].alpha * 3);
  }
}

template <class Real>
void expect_finite_for_few_steps() {
  for (const uint64_t dimension : {uint64_t{1}, uint64_t{156'000}}) {
    for (const double deviation : {0.0, 1e-3, 1.0, 100.0}) {
      for (const SolverMethod method : kMethods) {
        for (int flags = 0; flags < 8; ++flags) {
          for (const size_t steps : {1, 2, 3}) {
            std::vector<Real> start(64);
            std::vector<float> noise(64);
            fill_normal(1, steps, noise);
            for (size_t i = 0; i < 64; ++i) start[i] = static_cast<Real>(noise[i]);
            Given<Real> denoiser = gaussian<Real>(deviation);
            const Sampled<Real> run({method, (flags & 1) != 0, (flags & 2) != 0},
                                    levels_of(dimension, steps, (flags & 4) != 0), denoiser, start);
            ASSERT_TRUE(run.status.ok()) << run.status.message();
            for (const Real value : run.z) {
              ASSERT_TRUE(std::isfinite(value));
              ASSERT_LE(std::abs(value), 1000);
            }
          }
        }
      }
    }
  }
}

TEST(Solver, FewStepsAreFiniteInDouble) { expect_finite_for_few_steps<double>(); }
TEST(Solver, FewStepsAreFiniteInFloat) { expect_finite_for_few_steps<float>(); }

TEST(Solver, TheLastStepToNoNoiseIsThePrediction) {
  std::vector<NoiseLevel> levels(501);
  linear_beta_levels(levels);
  double last = 0;
  Given<double> denoiser(
      [&](std::span<const double> z, const NoiseLevel& level, size_t, std::span<double> x0) {
        last = x0[0] = 0.9 * level.alpha * z[0] + 0.1;
        return Status();
      });
  for (const SolverMethod method : kMethods) {
    const Sampled<double> run({method}, levels, denoiser, {1.25});
    ASSERT_TRUE(run.status.ok()) << run.status.message();
    EXPECT_EQ(run.z[0], last);
  }
}

TEST(Solver, TheFinalPredictionIsThatOfTheCleanEnd) {
  Given<double> denoiser(
      [](std::span<const double> z, const NoiseLevel& level, size_t, std::span<double> x0) {
        x0[0] = z[0] + level.lambda;
        return Status();
      });
  const NoiseLevel levels[] = {noise_level(-1), noise_level(2)};
  const Sampled<double> without({SolverMethod::kDdim}, levels, denoiser, {0.5});
  const Sampled<double> with({.method = SolverMethod::kDdim, .final_x0 = true}, levels, denoiser,
                             {0.5});
  EXPECT_EQ(with.z[0], without.z[0] + 2);
}

TEST(Solver, TheTraceSeesEveryStep) {
  struct Seen : SolverTrace<double> {
    std::vector<double> z, lambda;
    void after_step(size_t step, const NoiseLevel& level, std::span<const double> state,
                    std::span<const double>) override {
      EXPECT_EQ(step, z.size());
      z.push_back(state[0]);
      lambda.push_back(level.lambda);
    }
  } seen;
  Given<double> denoiser = gaussian<double>(0.5);
  const std::vector<NoiseLevel> levels = levels_of(100, 7, true);
  const Sampled<double> run({}, levels, denoiser, {1}, &seen);
  ASSERT_EQ(seen.z.size(), 7u);
  EXPECT_EQ(seen.z.back(), run.z[0]);
  for (size_t i = 0; i < 7; ++i) EXPECT_EQ(seen.lambda[i], levels[i + 1].lambda);
}

TEST(Solver, RefusesWhatIsNoRun) {
  Given<double> denoiser = constant(1);
  const NoiseLevel a = noise_level(-1), b = noise_level(1), no_noise = noise_level(INFINITY),
                   nan = noise_level(NAN);
  const std::vector<std::vector<NoiseLevel>> wrong = {{},
                                                      {a},
                                                      {b, a},
                                                      {a, a},
                                                      {nan, a},
                                                      {a, nan},
                                                      {no_noise, no_noise},
                                                      {b, {2, 1, 1}},
                                                      {a, noise_level(800), no_noise},
                                                      std::vector<NoiseLevel>(1002, a)};
  for (const std::vector<NoiseLevel>& levels : wrong) {
    EXPECT_EQ(Sampled<double>({}, levels, denoiser, {1}).status.code(),
              StatusCode::kInvalidArgument)
        << levels.size();
  }
  EXPECT_EQ(Sampled<double>({}, std::vector{a, b}, denoiser, {NAN}).status.code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(Sampled<double>({}, std::vector{a, b}, denoiser, {INFINITY}).status.code(),
            StatusCode::kInvalidArgument);
}

TEST(Solver, ReportsPredictionsAndStatesThatAreNotFinite) {
  const std::vector<NoiseLevel> levels = levels_of(100, 5, true);
  for (const double bad : {double(NAN), double(INFINITY), -double(INFINITY)}) {
    Given<double> denoiser(
        [&](std::span<const double>, const NoiseLevel&, size_t evaluation, std::span<double> x0) {
          x0[0] = 1;
          x0[1] = evaluation == 3 ? bad : 1;
          return Status();
        });
    const Sampled<double> run({}, levels, denoiser, {1, 1});
    EXPECT_EQ(run.status.code(), StatusCode::kInvalidArgument);
    EXPECT_EQ(run.status.message(), "sampling: prediction 3 is not finite");
  }
  // Finite predictions whose extrapolation is not.
  Given<float> far(
      [](std::span<const float>, const NoiseLevel&, size_t evaluation, std::span<float> x0) {
        x0[0] = evaluation % 2 == 0 ? 3e38f : -3e38f;
        return Status();
      });
  const Sampled<float> run({}, levels_of(100, 5, false), far, {1});
  EXPECT_EQ(run.status.message(), "sampling: step 1 is not finite");
}

TEST(Solver, ReturnsTheErrorOfTheDenoiser) {
  Given<double> denoiser([](std::span<const double>, const NoiseLevel&, size_t, std::span<double>) {
    return Status(StatusCode::kInterrupted, "stopped");
  });
  EXPECT_EQ(Sampled<double>({}, levels_of(100, 5, true), denoiser, {1}).status.code(),
            StatusCode::kInterrupted);
}

TEST(Solver, HasTheSameBitsOnEveryCpu) {
  std::vector<float> start(4);
  fill_normal(1, 2, start);
  Given<float> denoiser = gaussian<float>(0.5);
  const Sampled<float> run({}, levels_of(9'886, 10, true), denoiser, start);
  const float golden[4] = {-0x1.c0296ep-3f, -0x1.265e7ep-4f, 0x1.a82f4p-1f, 0x1.aae95ep-3f};
  for (size_t i = 0; i < 4; ++i)
    EXPECT_EQ(std::bit_cast<uint32_t>(run.z[i]), std::bit_cast<uint32_t>(golden[i])) << i;
}

}  // namespace
}  // namespace figurine::solver_test
