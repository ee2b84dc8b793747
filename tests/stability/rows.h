// What the stability cases measure: one row per claim, with its bound. The program writes them, the
// test asserts them.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <vector>

namespace figurine::stability {

enum class Bound { kAtLeast, kAtMost };

struct Row {
  std::string name;     // of the situation, e.g. "needles of 1 : 100000"
  std::string measure;  // of the value, e.g. "psnr_db against the float64 oracle"
  Bound bound = Bound::kAtMost;
  double limit = 0;
  double value = 0;

  // False for NaN.
  bool ok() const { return bound == Bound::kAtLeast ? value >= limit : value <= limit; }
};

using Rows = std::vector<Row>;

struct Case {
  const char* name;  // CamelCase, a test's name
  Rows (*run)();
};

std::span<const Case> splat_cases();
std::span<const Case> file_cases();
std::span<const Case> pose_cases();
std::span<const Case> live_cases();
std::span<const Case> package_cases();
std::span<const Case> fixed_point_cases();
std::span<const Case> sampling_cases();
std::span<const Case> sampler_cases();
std::span<const Case> training_cases();  // where the toolchain is built

}  // namespace figurine::stability
