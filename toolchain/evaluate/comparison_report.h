// What evaluate generation says of a comparison and of an audit, as JSON (docs/generation.md).
#pragma once

#include <nlohmann/json.hpp>

#include "toolchain/evaluate/bootstrap.h"
#include "toolchain/evaluate/novelty.h"
#include "toolchain/evaluate/sample_metrics.h"

namespace figurine::evaluate {

nlohmann::json finite(double value);                        // null where it is not
nlohmann::json to_json(const BootstrapInterval& interval);  // "value", "low", "high"
// "coverage_percent", "one_nna_percent", "one_nna_off_ideal": what does not depend on the distance's unit.
nlohmann::json describe_nearest(const SampleComparison& comparison, const BootstrapOptions& bootstrap);
nlohmann::json describe(const Novelty& novelty);

}  // namespace figurine::evaluate
