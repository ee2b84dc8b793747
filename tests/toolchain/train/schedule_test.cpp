// The learning rate: what a resumed run has to repeat.
#include <gtest/gtest.h>

#include "toolchain/train/schedule.h"

namespace figurine::train::schedule_test {
namespace {

TEST(Schedule, RampsThenFollowsTheCosineToItsFloor) {
  const Schedule schedule{.peak = 1e-3,
                          .ramp_iterations = 50,
                          .floor_fraction = 0.02,
                          .budget = {.iterations = 1000, .seconds = 0}};
  EXPECT_NEAR(learning_rate(schedule, 0, 0), 1e-3 / 50, 1e-12);
  EXPECT_NEAR(learning_rate(schedule, 500, 0), 1e-3 * (0.02 + 0.98 * 0.5), 1e-9);
  EXPECT_NEAR(learning_rate(schedule, 1000, 0), 2e-5, 1e-12);
  EXPECT_NEAR(learning_rate(schedule, 2000, 0), 2e-5, 1e-12) << "never below the floor";
}

TEST(Schedule, OfATimeBudgetFollowsTrainingSeconds) {
  const Schedule schedule{.peak = 1,
                          .ramp_iterations = 1,
                          .floor_fraction = 0,
                          .budget = {.iterations = 0, .seconds = 60}};
  EXPECT_NEAR(learning_rate(schedule, 12345, 30), 0.5, 1e-12);
  EXPECT_NEAR(progress(schedule.budget, 12345, 60), 1, 0);
}

}  // namespace
}  // namespace figurine::train::schedule_test
