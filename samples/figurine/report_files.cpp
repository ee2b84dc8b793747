#include "samples/figurine/report_files.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "ports/host/files.h"

namespace figurine::samples {

nlohmann::ordered_json finite_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

// The second is written only if the first could be, and takes it along if it fails.
Status write_report(const std::string& folder, const nlohmann::ordered_json& json,
                    const std::string& html) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Status(StatusCode::kIo, folder + ": cannot be made: " + error.message());
  const std::string text =
      json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  FIG_RETURN_IF_ERROR(
      ports::write_file_atomically(folder + "/report.json", std::as_bytes(std::span(text))));
  const Status status =
      ports::write_file_atomically(folder + "/report.html", std::as_bytes(std::span(html)));
  if (!status.ok()) std::filesystem::remove(folder + "/report.json", error);
  return status;
}

}  // namespace figurine::samples
