// The dials of figurine report for an avatar: what may be turned, between which settings, and what
// theory says of it. Tables of values; report_command.cpp draws and measures them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "figurine/frame.h"
#include "figurine/package.h"

namespace figurine::samples {

// What a setting may turn. A new kind of speed-up adds a member here and a row to dials().
struct Knobs {
  SplatOptions splat = {};
  LeaveOut leave_out = {};
  Approximation approximation = {};
  std::optional<Precision> precision = {};  // without: the one that the report is made in
};

struct Setting {
  std::string label;
  double value = 0;  // the dial's position, for orders of convergence
  bool is_default = false;
  Knobs knobs;
};

struct Dial {
  std::string name = {}, meaning = {};
  // Error ~ value^order; none: settings to choose from, with no order between them.
  std::optional<double> theoretical_order = {};
  std::string theory = {};
  Knobs reference = {};
  // That the dial can make cheaper: their time is the cost that is plotted.
  std::vector<Stage> stages = {};
  std::vector<Setting> settings = {};  // from coarse to fine
  // The picture depends on the frames before it: every setting goes through frames one after
  // another with a renderer of its own, and its cost is the mean over so many of them.
  uint32_t sequence = 1;
};

// The alpha cut of references: every contribution that float arithmetic can tell from nothing.
inline constexpr float kReferenceCut = 1e-7f;

// Of an avatar with both precisions (a dial of its own), and with bands of spherical harmonics up
// to a degree (a dial above 0).
std::vector<Dial> dials(bool both_precisions, uint32_t sh_degree);

}  // namespace figurine::samples
