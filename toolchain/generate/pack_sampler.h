// A trained sampler to its package: int8, the population's activation ranges, golden seeds made by
// the device's own sampler.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/sampler.h"
#include "toolchain/quantize/calibration.h"

namespace figurine::generate {

struct PackSamplerOptions {
  std::string run;         // of figurine-train sampler, variant basis
  std::string population;  // where it is now; empty: where the run found it
  std::string body;        // that the population's members stand on
  std::string name;        // empty: the population's
  std::string report;      // JSON of figurine-train evaluate generation; empty: none
  uint32_t steps = 20;     // evaluations where nobody says otherwise
  SolverMethod method = SolverMethod::kDpmSolverPlusPlus2M;
  uint32_t golden_seeds = 2;  // seeds 0, 1, ... whose weights every device must arrive at; emulated
                              // CPUs take seconds for one
  uint32_t calibration_poses = 8;  // of every training member, for the ranges
  quantize::CalibrationOptions calibration;
  uint32_t threads = 1;
  bool quiet = false;
};

// Throws InputError naming what does not fit.
std::vector<std::byte> pack_sampler(const PackSamplerOptions& options);

}  // namespace figurine::generate
