// The learning rate over a run: a short linear ramp, then half a cosine down to a floor at the end
// of the budget.
//
// The budget is a number of iterations or of training seconds. Both count training alone and are
// part of a checkpoint, so a resumed run goes on where it stopped. A run of a fixed number of
// iterations is reproducible to the bit; one of fixed seconds depends on the machine.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace figurine::train {

struct Budget {
  uint64_t iterations = 0;  // 0: not limited
  double seconds = 0;       // 0: not limited; exactly one of both is set
};

struct Schedule {
  double peak = 2e-3;
  uint64_t ramp_iterations = 50;
  double floor_fraction = 0.02;  // of the peak, reached at the end
  Budget budget;
};

// Share of the budget that is used up, in [0,1].
inline double progress(const Budget& budget, uint64_t iteration, double seconds) {
  const double share = budget.iterations > 0
                           ? static_cast<double>(iteration) / static_cast<double>(budget.iterations)
                           : seconds / budget.seconds;
  return std::clamp(share, 0.0, 1.0);
}

inline double learning_rate(const Schedule& schedule, uint64_t iteration, double seconds) {
  const double ramp =
      std::min(1.0, static_cast<double>(iteration + 1) /
                        static_cast<double>(std::max<uint64_t>(1, schedule.ramp_iterations)));
  const double cosine =
      0.5 * (1 + std::cos(3.14159265358979323846 * progress(schedule.budget, iteration, seconds)));
  return schedule.peak * ramp * (schedule.floor_fraction + (1 - schedule.floor_fraction) * cosine);
}

}  // namespace figurine::train
