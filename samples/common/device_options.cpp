#include "samples/common/device_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>

#include "ports/command_line/command_line.h"
#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/host/cpus.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/machine.h"
#include "samples/common/scene.h"

namespace figurine::samples {

namespace {

struct OmissionName {
  const char* name;
  bool LeaveOut::* member;
};
constexpr OmissionName kOmissions[] = {
    {"hidden-texels", &LeaveOut::hidden_texels},
    {"transparent", &LeaveOut::transparent},
    {"outside", &LeaveOut::outside},
    {"missed-tiles", &LeaveOut::missed_tiles},
    {"stopped", &LeaveOut::stopped},
    {"unchanged-networks", &LeaveOut::unchanged_networks},
};

// Those of this build and this CPU, the largest last.
std::string isa_names() {
  std::string names;
  for (const Isa isa : supported_isas())
    names += (names.empty() ? "" : ", ") + std::string(to_string(isa));
  return names;
}

nlohmann::ordered_json machine(uint32_t threads, const std::string& precision, const char* isa) {
  return {{"cpu", cpu_name()},
          {"cpus", ports::usable_cpus()},
          {"threads", threads},
          {"precision", precision},
          {"isa", isa}};
}

}  // namespace

void DeviceOptions::add_to(CLI::App& app, LeftOutOptions without) {
  app.add_option("--threads", threads,
                 "CPU threads, no more than usable CPUs; default: one for each, at most 8")
      ->check(ports::between(1, 64));
  app.add_flag("--force-threads", force_threads, "more threads than usable CPUs all the same");
  if (!without.precision) {
    app.add_option("--precision", precision,
                   "arithmetic of the network: f32, or q8 (fixed point); default: q8 where the "
                   "package has it");
  }
  app.add_option("--isa", isa,
                 "instruction set of figurine's own kernels, the same bits with each: " +
                     isa_names() + "; default: FIGURINE_ISA, else the last");
  if (!without.json) ports::add_json_option(app, json);
}

void add_avatars_argument(CLI::App& app, std::vector<std::string>& avatars) {
  app.add_option("avatars", avatars,
                 "avatar packages (.fgn), or members of populations (people.fgn#NAME, "
                 "people.fgn#17)")
      ->required();
}

void add_body_option(CLI::App& app, std::string& body) {
  app.add_option("--body", body,
                 "body package; default: found by content hash beside the avatar or sampler, in "
                 "FIGURINE_PATH, in the folders beside");
}

void add_motion_option(CLI::App& app, std::vector<std::string>& motions, const std::string& what) {
  app.add_option("--motion", motions, "motion package; default: " + what)->expected(1);
}

void add_camera_option(CLI::App& app, std::string& camera, const std::string& what) {
  app.add_option("--camera", camera,
                 "orbit:AZ,EL,DIST[,FOV], a JSON file, cameras.json#N of 3DGS or transforms.json#N "
                 "of a NeRF; default: " +
                     what);
}

void add_size_option(CLI::App& app, std::string& size, const std::string& what) {
  app.add_option("--size", size, "WIDTHxHEIGHT; default: " + what);
}

void add_near_option(CLI::App& app, std::optional<float>& near_m, const std::string& what) {
  app.add_option("--near", near_m,
                 "metres; Gaussians nearer than this are culled; default: " + what)
      ->check(ports::positive());
}

void add_background_option(CLI::App& app, std::string& background, bool alpha,
                           const std::string& what) {
  app.add_option(
      "--background", background,
      std::string(alpha ? "alpha, " : "") +
          "black, grey, white, #RRGGBB or R,G,B (#00b140: a chroma key); default: " + what);
}

void ViewOptions::add_still_to(CLI::App& app) {
  add_camera_option(app, camera, "frames the figures");
  app.add_option("--framing", framing,
                 "what of the figures the picture holds, and an orbit is about: bust is head and "
                 "shoulders")
      ->check(ports::one_of({"body", "bust", "head"}))
      ->capture_default_str();
  add_size_option(app, size, "the camera's, or the avatar's golden frame's");
}

void ViewOptions::add_to(CLI::App& app) {
  add_still_to(app);
  app.add_option("--follow", follow,
                 "what an orbit's target does: smooth (goes along with the figures) or off (stays)")
      ->check(ports::one_of({"smooth", "off"}))
      ->capture_default_str();
  add_near_option(app, near_m, "0.2");
}

Result<CameraPathOptions> ViewOptions::camera_path() const {
  CameraPathOptions path{.follow = follow == "smooth", .near_m = near_m};
  if (!size.empty()) {
    const Result<ImageSize> parsed = parse_size(size);
    if (!parsed.ok()) return parsed.status();
    path.size = *parsed;
  }
  const Result<Framing> parsed = parse_framing(framing);
  if (!parsed.ok()) return parsed.status();
  path.framing = *parsed;
  if (!camera.empty()) {
    const Result<CameraSpec> spec = parse_camera_spec(camera);
    if (!spec.ok()) return spec.status();
    path.camera = *spec;
  }
  return path;
}

void add_place_options(CLI::App& app, SceneOptions& options, bool places) {
  if (places) {
    app.add_option("--place", options.places,
                   "X,Z[,HEADING] in metres and degrees, once for each avatar")
        ->expected(1)
        ->take_all();
  }
  app.add_option("--spacing", options.spacing_m, "metres between avatars side by side")
      ->check(ports::between(-1000.0, 1000.0))
      ->capture_default_str();
  app.add_option("--coarse", options.coarse,
                 "avatar packages of the same people in less detail, one for all or one for each: "
                 "what small figures are drawn by (--coarse-below-px)")
      ->expected(1)
      ->take_all();
  app.add_option("--crowd", options.crowd,
                 "so many of every avatar, in rows and columns, each at a moment of its own")
      ->check(ports::between(1, 1024))
      ->capture_default_str();
  app.add_flag("--keep-to-known", options.keep_to_known,
               "show networks a nearer pose where one is farther out than 95 % of those that they "
               "were trained on; skinning keeps the true one (docs/poses.md)");
}

void OmissionOptions::add_to(CLI::App& app) {
  Approximation& approximation = asked;
  app.add_option("--network-hz", network_hz,
                 "run each network so many times a second of the frames' own rate; in between its "
                 "outputs go on in a straight line; 0: at every frame")
      ->check(ports::between(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--network-below-px", approximation.network_below_px,
                 "figures whose box in the image is smaller than this many pixels keep what their "
                 "network said of an earlier pose; 0: never")
      ->check(ports::between(0.0, 65536.0))
      ->capture_default_str();
  app.add_option("--coarse-below-px", approximation.coarse_below_px,
                 "figures smaller than this in the image are drawn by their --coarse; 0: never")
      ->check(ports::between(0.0, 65536.0))
      ->capture_default_str();
  app.add_option("--averted-above", approximation.averted_above,
                 "leave out what faces away from the camera: cosine between line of sight and "
                 "surface; 1: nothing")
      ->check(ports::between(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--sh-degree", approximation.sh_degree,
                 "leave out spherical harmonics above this degree")
      ->check(ports::between(0, kMaxShDegree))
      ->capture_default_str();
  app.add_flag("--fast-blend", approximation.fast_blend,
               "blend by the fast tier: over 50 dB from the exact picture, and other last bits on "
               "other CPUs");
  std::vector<std::string> names;
  for (const OmissionName& omission : kOmissions) names.push_back(omission.name);
  app.add_option("--keep", kept,
                 "compute what changes no pixel and would be left out, to see what that is worth")
      ->expected(1)
      ->take_all()
      ->check(ports::one_of(names));
}

LeaveOut OmissionOptions::leave_out() const {
  LeaveOut leave_out;
  for (const OmissionName& omission : kOmissions) {
    if (std::find(kept.begin(), kept.end(), omission.name) != kept.end())
      leave_out.*omission.member = false;
  }
  return leave_out;
}

Approximation OmissionOptions::approximation(double frames_per_second) const {
  Approximation approximation = asked;
  if (network_hz > 0) {
    approximation.network_interval =
        static_cast<uint32_t>(std::clamp(std::round(frames_per_second / network_hz), 1.0, 1e6));
  }
  return approximation;
}

void add_json(const Approximation& approximation, nlohmann::ordered_json& json) {
  json["network_below_px"] = approximation.network_below_px;
  json["network_interval"] = approximation.network_interval;
  json["coarse_below_px"] = approximation.coarse_below_px;
  json["averted_above"] = approximation.averted_above;
  json["sh_degree"] = approximation.sh_degree;
  json["fast_blend"] = approximation.fast_blend;
}

Result<RendererOptions> DeviceOptions::renderer_options() const {
  if (!precision.empty() && !network_precision()) {
    return Status(StatusCode::kUnsupported,
                  "precision '" + precision + "' is unsupported in this build; it has f32 and q8");
  }
  const Result<Isa> kernels = instruction_set();
  if (!kernels.ok()) return kernels.status();
  const uint32_t cpus = ports::usable_cpus(), wanted = threads != 0 ? threads : std::min(cpus, 8u);
  if (wanted > cpus && !force_threads) {
    ports::say("--threads " + std::to_string(wanted) + ": lowered to the " + std::to_string(cpus) +
               " usable (--force-threads)");
  }
  return RendererOptions{.threads = force_threads ? wanted : std::min(wanted, cpus),
                         .allow_oversubscription = force_threads,
                         .now_ns = [](void*) { return ports::now_ns(); },
                         .isa = *kernels};
}

Result<Isa> DeviceOptions::instruction_set() const { return samples::instruction_set(isa); }

Result<Isa> instruction_set(const std::string& isa) {
  const char* const environment = std::getenv("FIGURINE_ISA");
  const std::string name = !isa.empty() ? isa : (environment != nullptr ? environment : "");
  if (name.empty()) return supported_isas().back();
  const std::string where = isa.empty() ? "FIGURINE_ISA: " : "";
  const std::optional<Isa> known = isa_from_string(name);
  const std::span<const Isa> supported = supported_isas();
  if (known && std::find(supported.begin(), supported.end(), *known) != supported.end()) {
    return *known;
  }
  return Status(StatusCode::kUnsupported,
                where + "isa '" + name +
                    "' is unsupported in this build or by this CPU; there is " + isa_names());
}

Result<std::unique_ptr<Renderer>> make_renderer(const RendererOptions& options) {
  Result<std::unique_ptr<Renderer>> renderer = Renderer::create(options);
  if (renderer.ok() && (*renderer)->threads() < options.threads) {
    ports::say(std::to_string((*renderer)->threads()) + " of " + std::to_string(options.threads) +
               " threads: the system gives no more");
  }
  return renderer;
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
  const Result<Isa> isa = options.instruction_set();  // renderer_options() has looked at it
  return machine(threads, precision, isa.ok() ? to_string(*isa) : "none");
}

nlohmann::ordered_json json_sampling_machine(Isa isa) {
  return machine(1, to_string(Precision::kFixedPoint), to_string(isa));
}

Status write_json(const std::string& where, const nlohmann::ordered_json& json) {
  if (where.empty()) return {};
  // Names from outside may hold bytes that are no UTF-8: replaced, never thrown at the user.
  const std::string text =
      json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  if (where != "-") return ports::write_file_atomically(where, std::as_bytes(std::span(text)));
  std::fputs(text.c_str(), stdout);  // whether it arrives is seen in the end (run_program)
  return {};
}

}  // namespace figurine::samples
