#include "samples/common/device_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "ports/host/clock.h"
#include "ports/host/cpus.h"
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

void DeviceOptions::add_to(CLI::App& app, bool json_flag) {
  app.add_option("--threads", threads,
                 "CPU threads, no more than usable CPUs; default: one for each, at most 8")
      ->check(CLI::Range(1u, 64u));
  app.add_flag("--force-threads", force_threads, "more threads than usable CPUs all the same");
  app.add_option(
      "--precision", precision,
      "arithmetic of the network: f32, or q8 (fixed point); default: q8 where the package has it");
  add_isa_option(app, isa);
  if (json_flag) app.add_flag("--json", json, "print a summary as JSON to standard output");
}

void add_crowd_options(CLI::App& app, SceneOptions& options) {
  app.add_option("--coarse", options.coarse,
                 "avatar packages of the same people in less detail, one for all or one for each: "
                 "what small figures are drawn by (--coarse-below-px)")
      ->expected(1)
      ->take_all();
  app.add_option("--crowd", options.crowd,
                 "so many of every avatar, in rows and columns, each at a moment of its own")
      ->check(CLI::Range(1u, 1024u))
      ->capture_default_str();
}

void OmissionOptions::add_to(CLI::App& app) {
  Approximation& approximation = asked;
  app.add_option("--network-hz", network_hz,
                 "run each network so many times a second of the frames' own rate; in between its "
                 "outputs go on in a straight line; 0: at every frame")
      ->check(CLI::Range(0.0f, 1000.0f))
      ->capture_default_str();
  app.add_option("--network-below-px", approximation.network_below_px,
                 "figures whose box in the image is smaller than this many pixels keep what their "
                 "network said of an earlier pose; 0: never")
      ->check(CLI::Range(0.0f, 65536.0f))
      ->capture_default_str();
  app.add_option("--coarse-below-px", approximation.coarse_below_px,
                 "figures smaller than this in the image are drawn by their --coarse; 0: never")
      ->check(CLI::Range(0.0f, 65536.0f))
      ->capture_default_str();
  app.add_option("--averted-above", approximation.averted_above,
                 "leave out what faces away from the camera: cosine between line of sight and "
                 "surface; 1: nothing")
      ->check(CLI::Range(0.0f, 1.0f))
      ->capture_default_str();
  app.add_option("--sh-degree", approximation.sh_degree,
                 "leave out spherical harmonics above this degree")
      ->check(CLI::Range(0u, kMaxShDegree))
      ->capture_default_str();
  app.add_flag("--fast-blend", approximation.fast_blend,
               "blend by the fast tier: over 50 dB from the exact picture, and other last bits on "
               "other CPUs");
  std::vector<std::string> names;
  for (const OmissionName& omission : kOmissions) names.push_back(omission.name);
  app.add_option(
         "--keep", kept,
         "compute what changes no pixel and would be left out, to see what that is worth: " +
             CLI::detail::join(names, ", "))
      ->expected(1)
      ->take_all()
      ->check(CLI::IsMember(names));
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
    std::fprintf(stderr, "figurine: --threads %u: lowered to the %u usable (--force-threads)\n",
                 wanted, cpus);
  }
  return RendererOptions{.threads = force_threads ? wanted : std::min(wanted, cpus),
                         .allow_oversubscription = force_threads,
                         .now_ns = [](void*) { return ports::now_ns(); },
                         .isa = *kernels};
}

Result<Isa> DeviceOptions::instruction_set() const { return samples::instruction_set(isa); }

void add_isa_option(CLI::App& app, std::string& isa) {
  app.add_option("--isa", isa,
                 "instruction set of figurine's own kernels, the same bits with each: " +
                     isa_names() + "; default: FIGURINE_ISA, else the last");
}

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
    std::fprintf(stderr, "figurine: %u of %u threads: the system gives no more\n",
                 (*renderer)->threads(), options.threads);
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

void print_json(const nlohmann::ordered_json& json) {
  // Names from outside may hold bytes that are no UTF-8: replaced, never thrown at the user.
  std::printf("%s\n",
              json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
}

}  // namespace figurine::samples
