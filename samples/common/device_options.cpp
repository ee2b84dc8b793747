#include "samples/common/device_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "ports/host/clock.h"
#include "samples/common/machine.h"

namespace figurine::samples {

void DeviceOptions::add_to(CLI::App& app, bool json_flag) {
  app.add_option("--threads", threads, "CPU threads; default: as many as there are CPUs, at most 8")
      ->check(CLI::Range(1u, 64u));
  app.add_option(
      "--precision", precision,
      "arithmetic of the network: f32, or q8 (fixed point); default: q8 where the package has it");
  app.add_option("--isa", isa, "kernels of the splatter: scalar")->capture_default_str();
  if (json_flag) app.add_flag("--json", json, "print a summary as JSON to standard output");
}

Result<RendererOptions> DeviceOptions::renderer_options() const {
  if (!precision.empty() && !network_precision()) {
    return Status(StatusCode::kUnsupported,
                  "precision '" + precision + "' is unsupported in this build; it has f32 and q8");
  }
  if (isa != "scalar")
    return Status(StatusCode::kUnsupported,
                  "isa '" + isa + "' is unsupported in this build; it has scalar");
  return RendererOptions{.threads = threads != 0 ? threads : std::min(usable_cpus(), 8u),
                         .now_ns = ports::now_ns};
}

std::optional<Precision> DeviceOptions::network_precision() const {
  for (const Precision known : {Precision::kFloat32, Precision::kFixedPoint}) {
    if (precision == to_string(known)) return known;
  }
  return std::nullopt;
}

nlohmann::ordered_json json_header(const char* command) {
  return {{"command", command}, {"version", FIGURINE_VERSION}};
}

nlohmann::ordered_json json_machine(const DeviceOptions& options, uint32_t threads,
                                    const std::string& precision) {
  return {{"cpu", cpu_name()},
          {"cpus", usable_cpus()},
          {"threads", threads},
          {"precision", precision},
          {"isa", options.isa}};
}

void print_json(const nlohmann::ordered_json& json) {
  // Names from outside may hold bytes that are no UTF-8: replaced, never thrown at the user.
  std::printf("%s\n",
              json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
}

}  // namespace figurine::samples
