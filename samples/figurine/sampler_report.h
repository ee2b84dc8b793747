// figurine report of a sampler: what the number of evaluations costs, and what it buys in pictures
// of the sampled people.
#pragma once

#include <optional>
#include <string>

#include "figurine/isa.h"
#include "figurine/status.h"
#include "samples/common/loading.h"

namespace figurine::samples {

struct SamplerReportOptions {
  std::string body;        // empty: found by content hash
  std::optional<Isa> isa;  // none: the largest there is
  uint32_t seeds = 4;      // 0, 1, ...: people whose errors are pooled
  std::string output;      // folder for report.json and report.html
  std::string json;        // as write_json() takes it
};

Status run_sampler_report(const LoadedPackage& sampler, const SamplerReportOptions& options);

}  // namespace figurine::samples
