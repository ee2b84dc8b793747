// A trained sampler to its package: int8, the population's activation ranges, golden seeds that the
// caller samples on the device's own code.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
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
  // How the device's own code samples them (verify::sample_golden_seeds): nothing of this folder
  // runs the device. Needed where golden_seeds is above 0 (FIG_CHECK).
  std::function<std::vector<GoldenSeed>(const Sampler& sampler, uint32_t count)> sample_on_device;
  uint32_t calibration_poses = 8;  // of every training member, for the ranges
  quantize::CalibrationOptions calibration;
  uint32_t threads = 1;
  bool quiet = false;
};

// Throws InputError naming what does not fit.
std::vector<std::byte> pack_sampler(const PackSamplerOptions& options);

}  // namespace figurine::generate
