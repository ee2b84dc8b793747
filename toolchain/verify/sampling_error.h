// What the number of evaluations costs and buys: the error of sampled weights, and of the pictures
// of sampled people, against the exact solution of the same denoiser; for the closed-form oracle in
// double, the trained network in float, and the device's in integers.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "figurine/package.h"
#include "toolchain/generate/sampler_trainer.h"

namespace figurine::verify {

struct SamplingErrorOptions {
  std::vector<uint32_t> evaluations = {1, 2, 3, 5, 10, 20, 30, 50, 100, 250};
  uint32_t reference_evaluations = 1000;  // of DPM-Solver++(2M): what counts as exact
  size_t seeds = 4;                       // 0, 1, ...; errors are pooled
  bool quiet = false;
};

// Rows {denoiser, solver, evaluations, rms_error, seconds}: rms over values of unit scale, seconds
// of one vector on the calling thread; integer rows also {float_rms_error, picture_db}: against the
// float network's exact solution, and the PSNR of the person's pictures against those of the exact
// one. Objects `order`: observed slopes between 50 and 250 evaluations, `floor`: where the
// integers' error ends. sampler: the trained one's package. Throws InputError.
nlohmann::json measure_sampling_error(const generate::TrainedSampler& trained,
                                      const Sampler& sampler, const Package& body,
                                      const SamplingErrorOptions& options);

}  // namespace figurine::verify
