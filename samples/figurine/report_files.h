// The two files of figurine report.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "figurine/status.h"

namespace figurine::samples {

// DIR/report.json and DIR/report.html, both or none.
Status write_report(const std::string& folder, const nlohmann::ordered_json& json,
                    const std::string& html);

}  // namespace figurine::samples
