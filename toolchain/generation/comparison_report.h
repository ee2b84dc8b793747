// What evaluate generation says of a comparison and of an audit, as JSON (docs/generation.md).
#pragma once

#include <nlohmann/json.hpp>

#include "toolchain/generation/novelty.h"
#include "toolchain/measure/bootstrap.h"
#include "toolchain/measure/sample_metrics.h"

namespace figurine::generation {

nlohmann::json to_json(const measure::BootstrapInterval& interval);  // "value", "low", "high"

enum class DistanceUnit { kSquaredError, kOther };
// Of the first draw of samples, with intervals: "count", "mmd_psnr_db" (of squared errors) or
// "mmd", "coverage_percent", "one_nna_percent", "one_nna_off_ideal". "draws", where there are
// several: their "count" and the means over all of them.
nlohmann::json describe_draws(const measure::SampleDistances& distances, DistanceUnit unit,
                              const measure::BootstrapOptions& bootstrap);
nlohmann::json describe(const Novelty& novelty);

}  // namespace figurine::generation
