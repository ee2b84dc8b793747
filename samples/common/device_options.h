// The options that commands on the device share, each defined once (docs/command_line.md), and the
// summary that --json asks for.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "figurine/status.h"
#include "samples/common/camera_path.h"

namespace CLI {
class App;
}

namespace figurine::samples {

// What a command has no use for: --precision where no network runs, --json where there is nothing
// to sum up.
struct LeftOutOptions {
  bool precision = false;
  bool json = false;
};

struct DeviceOptions {
  std::string precision;       // empty: the best that an avatar holds
  std::string isa;             // empty: FIGURINE_ISA of the environment, else the largest there is
  uint32_t threads = 0;        // 0: one a usable CPU, 8 at most
  bool force_threads = false;  // more than usable CPUs
  std::string json;            // where the summary goes: empty, "-" or a file

  void add_to(CLI::App& app, LeftOutOptions without = {});
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

// The instruction set of our own kernels that --isa (empty: not given) and the environment ask for:
// the same bits with every one. kUnsupported for what is not there.
Result<Isa> instruction_set(const std::string& isa);

struct SceneOptions;
// The figures of a scene: avatars, and where their body is.
void add_avatars_argument(CLI::App& app, std::vector<std::string>& avatars);
void add_body_option(CLI::App& app, std::string& body);
void add_motion_option(CLI::App& app, std::vector<std::string>& motions, const std::string& what);
// Where they stand: --place (unless places is false), --spacing, --coarse and --crowd; and
// --keep-to-known.
void add_place_options(CLI::App& app, SceneOptions& options, bool places = true);

// How they are seen: --camera, --framing and --size; unless the camera stays, --follow and --near.
struct ViewOptions {
  std::string camera, size, framing = "body", follow = "smooth";
  std::optional<float> near_m;

  void add_to(CLI::App& app);
  void add_still_to(CLI::App& app);  // without --follow and --near
  // kInvalidArgument for a camera, a size or a framing that is none.
  Result<CameraPathOptions> camera_path() const;
};
// One of them alone. what: the default.
void add_camera_option(CLI::App& app, std::string& camera, const std::string& what);
void add_size_option(CLI::App& app, std::string& size, const std::string& what);
void add_near_option(CLI::App& app, std::optional<float>& near_m, const std::string& what);
// alpha: whether "alpha" is one of the answers.
void add_background_option(CLI::App& app, std::string& background, bool alpha,
                           const std::string& what);

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
// To where --json says: a file, whole or not at all, or standard output; nothing where it is empty.
Status write_json(const std::string& where, const nlohmann::ordered_json& json);

}  // namespace figurine::samples
