// The page of figurine report: one self-contained HTML file, no script, no network. Takes the
// report as JSON (docs/json.md) and draws it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace figurine::samples {

// A picture inside the page.
struct ReportPicture {
  std::string caption;
  std::vector<std::byte> png;
};

std::string report_html(const nlohmann::ordered_json& report,
                        const std::vector<ReportPicture>& pictures);

}  // namespace figurine::samples
