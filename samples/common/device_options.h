// The options that every device command has, and the summary that --json prints.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "figurine/status.h"

namespace CLI {
class App;
}

namespace figurine::samples {

struct DeviceOptions {
  std::string precision;       // empty: the best that an avatar holds
  std::string isa;             // empty: FIGURINE_ISA of the environment, else the largest there is
  uint32_t threads = 0;        // 0: one a usable CPU, 8 at most
  bool force_threads = false;  // more than usable CPUs
  bool json = false;

  // json_flag: whether the command has the plain --json; bench has one of its own.
  void add_to(CLI::App& app, bool json_flag = true);
  // kUnsupported for what this build cannot do, never a silent replacement: threads beyond the
  // usable CPUs are left out with a line on standard error.
  Result<RendererOptions> renderer_options() const;
  // As asked for; without, the renderer's own choice. renderer_options() has looked at it.
  std::optional<Precision> network_precision() const;
  // Of packages that are opened to be drawn.
  OpenOptions open_options() const {
    return OpenOptions::for_drawing(network_precision().value_or(Precision::kFixedPoint));
  }
  Result<Isa> instruction_set() const;
};

// --isa alone, for a command that has no other of the options above.
void add_isa_option(CLI::App& app, std::string& isa);
// The instruction set of our own kernels that --isa (empty: not given) and the environment ask for:
// the same bits with every one. kUnsupported for what is not there.
Result<Isa> instruction_set(const std::string& isa);

struct SceneOptions;
// --coarse and --crowd.
void add_crowd_options(CLI::App& app, SceneOptions& options);

// What a command leaves out, exactly or although it shows.
struct OmissionOptions {
  Approximation asked;
  float network_hz = 0;           // 0: asked.network_interval as it is
  std::vector<std::string> kept;  // names of LeaveOut's switches that are off

  void add_to(CLI::App& app);
  // For frames that follow each other at this rate.
  Approximation approximation(double frames_per_second) const;
  LeaveOut leave_out() const;
};
// Its fields in a --json output.
void add_json(const Approximation& approximation, nlohmann::ordered_json& json);

// Renderer::create, with a line on standard error where the system gives fewer threads than asked
// for.
Result<std::unique_ptr<Renderer>> make_renderer(const RendererOptions& options);

// "command" and "version", the first fields of every --json output (docs/json.md).
nlohmann::ordered_json json_header(const char* command);
// CPU, usable CPUs, threads in use, precision of the networks that ran, and kernels.
nlohmann::ordered_json json_machine(const DeviceOptions& options, uint32_t threads,
                                    const std::string& precision);
// The same of a command that samples weights: one thread, integers.
nlohmann::ordered_json json_sampling_machine(Isa isa);
void print_json(const nlohmann::ordered_json& json);

}  // namespace figurine::samples
