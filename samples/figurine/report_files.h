// The two files of figurine report, and what its reports have in common.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "figurine/status.h"

namespace figurine::samples {

// JSON has no infinity: the PSNR of what is equal is null.
nlohmann::ordered_json finite_or_null(double value);

// DIR/report.json and DIR/report.html, both or none.
Status write_report(const std::string& folder, const nlohmann::ordered_json& json,
                    const std::string& html);

}  // namespace figurine::samples
