// figurine bench: what a frame costs on this machine, stage by stage: of figures in every precision
// that their packages hold, or of a file of Gaussians; on one thread and on several. Every frame
// has a fresh pose and a run of the network, or a fresh camera.
//
// Precisions and thread counts take turns frame by frame, so that whatever else the machine does
// falls on all of them alike; medians are compared, not means. With --hz there is one of them, and
// its frames begin at ticks of a steady clock: what is counted then is deadlines missed.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "samples/common/deadlines.h"
#include "samples/common/device_options.h"
#include "samples/common/machine.h"
#include "samples/common/progress.h"
#include "samples/figurine/bench_lane.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

constexpr uint32_t kWarmUpFrames = 3;

struct BenchOptions {
  BenchSubject subject;
  DeviceOptions device;
  ViewOptions view;
  std::string roofline;
  double hz = 0;  // 0: as fast as it goes
};

// What is asked for; otherwise all that every avatar holds, the renderer's own choice first; that
// choice alone where they have none in common.
Result<std::vector<std::optional<Precision>>> choose_precisions(const BenchOptions& options) {
  using Precisions = std::vector<std::optional<Precision>>;
  if (!options.subject.ply.empty()) return Precisions{std::nullopt};
  if (const std::optional<Precision> asked = options.device.network_precision())
    return Precisions{asked};
  if (options.hz > 0) return Precisions{std::nullopt};
  const Result<Scene> scene = Scene::load(options.subject.scene);
  if (!scene.ok()) return scene.status();
  Precisions precisions;
  for (const Precision precision : {Precision::kFixedPoint, Precision::kFloat32}) {
    if (scene->holds(precision)) precisions.push_back(precision);
  }
  if (precisions.empty()) precisions.push_back(std::nullopt);
  return precisions;
}

// Of every package once.
std::pair<uint64_t, uint64_t> package_bytes(const Scene& scene) {
  std::set<const LoadedAvatar*> avatars;
  std::set<const LoadedPackage*> bodies;
  uint64_t avatar_bytes = 0, body_bytes = 0;
  for (size_t i = 0; i < scene.size(); ++i) {
    if (avatars.insert(&scene.avatar(i)).second)
      avatar_bytes += scene.avatar(i).package->package.size_bytes();
    if (bodies.insert(&scene.body(i)).second) body_bytes += scene.body(i).package.size_bytes();
  }
  return {avatar_bytes, body_bytes};
}

void print_table(const nlohmann::ordered_json& json) {
  const auto& lanes = json["runs"];
  std::printf("%s, %s\n", json["machine"]["cpu"].get<std::string>().c_str(),
              json["date"].get<std::string>().c_str());
  std::printf("%u frames of %ux%u, %s; milliseconds, median (90th percentile)\n\n",
              json["frames"].get<uint32_t>(), json["size"][0].get<uint32_t>(),
              json["size"][1].get<uint32_t>(),
              json["avatars"].empty() ? "from all around" : "a fresh pose each");
  const auto precision = [](const auto& lane) {
    return lane["precision"].is_null() ? std::string("-")
                                       : lane["precision"].template get<std::string>();
  };
  std::printf("%-12s", "precision");
  for (const auto& lane : lanes) std::printf("%20s", precision(lane).c_str());
  std::printf("\n%-12s", "threads");
  for (const auto& lane : lanes) std::printf("%20u", lane["threads"].get<uint32_t>());
  std::printf("\n");
  for (const auto& [stage, first] : lanes[0]["stages_ms"].items()) {
    std::printf("%-12s", stage.c_str());
    for (const auto& lane : lanes) {
      std::printf("%11.3f (%6.3f)", lane["stages_ms"][stage]["median"].get<double>(),
                  lane["stages_ms"][stage]["p90"].get<double>());
    }
    std::printf("\n");
  }
  std::printf("%-12s", "p99");
  for (const auto& lane : lanes)
    std::printf("%20.3f", lane["stages_ms"]["total"]["p99"].get<double>());
  std::printf("\n%-12s", "over 16.7 ms");
  for (const auto& lane : lanes)
    std::printf("%20llu", static_cast<unsigned long long>(lane["missed_60hz"].get<uint64_t>()));
  std::printf("\n");
  if (json.contains("paced")) {
    const auto& paced = json["paced"];
    std::printf("\npaced at %g Hz: %llu of %llu frames missed their deadline, %llu ticks dropped\n",
                paced["hz"].get<double>(),
                static_cast<unsigned long long>(paced["missed"].get<uint64_t>()),
                static_cast<unsigned long long>(paced["frames"].get<uint64_t>()),
                static_cast<unsigned long long>(paced["dropped"].get<uint64_t>()));
    for (const auto& [key, meaning] : {std::pair("latency_ms", "from tick to picture"),
                                       std::pair("wait_ms", "of it, until the frame began")}) {
      std::printf("%-29s p50 %.3f, p99 %.3f, worst %.3f ms\n", meaning,
                  paced[key]["p50"].get<double>(), paced[key]["p99"].get<double>(),
                  paced[key]["worst"].get<double>());
    }
  }
  if (lanes[0].contains("roofline")) {
    std::printf("\nshare of this machine's peak:\n");
    for (const auto& [stage, first] : lanes[0]["roofline"].items()) {
      std::printf("%-12s", stage.c_str());
      for (const auto& lane : lanes) {
        const auto& shares = lane["roofline"];
        if (!shares.contains(stage)) {
          std::printf("%20s", "-");
          continue;
        }
        std::printf("%19.1f%%", 100 * shares[stage]["share"].template get<double>());
      }
      std::printf("  of %s\n",
                  stage == "network" ? "MACs" : first["of"].get<std::string>().c_str());
    }
  }
  const auto& work = lanes[0]["work"];
  std::printf("\nwork a frame: %.3f GMAC, %llu Gaussians, %llu visible, %llu pairs, %llu blends\n",
              work["macs"].get<double>() * 1e-9,
              static_cast<unsigned long long>(work["gaussians"].get<uint64_t>()),
              static_cast<unsigned long long>(work["visible"].get<uint64_t>()),
              static_cast<unsigned long long>(work["pairs"].get<uint64_t>()),
              static_cast<unsigned long long>(work["blends"].get<uint64_t>()));
  const auto& first = json["first_frame_ms"];
  std::printf("first frame: %.1f ms from opening (open %.1f, prepare %.1f, render %.1f)\n",
              first["total"].get<double>(), first["open"].get<double>(),
              first["prepare"].get<double>(), first["render"].get<double>());
  std::printf("memory: renderer %.1f MB, process peak %.1f MB",
              lanes[0]["renderer_memory_bytes"].get<double>() * 1e-6,
              json["peak_memory_bytes"].get<double>() * 1e-6);
  if (!json["avatars"].empty())
    std::printf("; packages: avatars %.2f MB, bodies %.2f MB",
                json["avatar_bytes"].get<double>() * 1e-6, json["body_bytes"].get<double>() * 1e-6);
  std::printf("\n");
  if (!lanes[0]["allocations_per_frame"].is_null()) {
    std::printf("allocations a frame:");
    for (const auto& lane : lanes)
      std::printf(" %.2f (%s, %u threads)", lane["allocations_per_frame"].get<double>(),
                  precision(lane).c_str(), lane["threads"].get<uint32_t>());
    std::printf("\n");
  }
}

// Figures, or one file of Gaussians.
Result<BenchSubject> subject_of(const BenchOptions& options) {
  BenchSubject subject = options.subject;
  std::vector<std::string>& inputs = subject.scene.avatars;
  const auto is_ply = [](const std::string& name) { return name.ends_with(".ply"); };
  if (std::any_of(inputs.begin(), inputs.end(), is_ply)) {
    if (inputs.size() > 1)
      return Status(StatusCode::kInvalidArgument, inputs[0] + ": one .ply file, or avatars");
    if (!subject.scene.motions.empty())
      return Status(StatusCode::kInvalidArgument, inputs[0] + ": does not move: no --motion");
    subject.ply = inputs[0];
    inputs.clear();
  }
  Result<CameraPathOptions> path = options.view.camera_path();
  if (!path.ok()) return path.status();
  if (!options.view.camera.empty() && !subject.ply.empty())
    return Status(StatusCode::kInvalidArgument, subject.ply + ": is turned, without --camera");
  subject.size = path->size;
  subject.framing = path->framing;
  subject.camera = std::move(path->camera);
  return subject;
}

nlohmann::ordered_json describe(const BenchSubject& subject, const std::vector<BenchLane>& lanes) {
  nlohmann::ordered_json json;
  json["avatars"] = subject.scene.avatars;
  json["scene"] =
      subject.ply.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(subject.ply);
  if (const Scene* figures = lanes[0].figures()) {
    const auto [avatar_bytes, body_bytes] = package_bytes(*figures);
    json["avatar_bytes"] = avatar_bytes;
    json["body_bytes"] = body_bytes;
  }
  json["motion"] = subject.scene.motions.empty() ? nlohmann::ordered_json()
                                                 : nlohmann::ordered_json(subject.scene.motions[0]);
  json["frames"] = subject.frames;
  json["figures"] = lanes[0].figures() ? lanes[0].figures()->size() : 0;
  add_json(lanes[0].approximation(), json);
  json["keep_to_known"] = subject.scene.keep_to_known;
  json["size"] = {lanes[0].size().width_px, lanes[0].size().height_px};
  return json;
}

// Every lane's frame i, by turns.
Status run_by_turns(std::vector<BenchLane>& lanes, uint32_t frames, RenderedFrame& frame) {
  Progress progress("bench", frames);
  for (uint32_t i = 0; i < frames; ++i) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    for (size_t turn = 0; turn < lanes.size(); ++turn)
      FIG_RETURN_IF_ERROR(lanes[(i + turn) % lanes.size()].render(i, frame, true));
    progress.update(i + 1);
  }
  return {};
}

// A frame at every tick that is not dropped. Progress is drawn between a frame's end and the next
// tick, on the time that is left over.
Status run_paced(BenchLane& lane, uint32_t frames, RenderedFrame& frame, Deadlines& deadlines) {
  Progress progress("bench", frames);
  for (uint32_t i = 0; i < frames; ++i) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    ports::sleep_until(deadlines.tick_ns());
    const uint64_t began_ns = ports::now_ns();
    FIG_RETURN_IF_ERROR(lane.render(i, frame, true));
    deadlines.add(began_ns, ports::now_ns());
    progress.update(i + 1);
  }
  return {};
}

Status run_bench(BenchOptions options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  const Result<BenchSubject> subject = subject_of(options);
  if (!subject.ok()) return subject.status();
  options.subject = *subject;
  std::optional<Roofline> roofline;
  if (!options.roofline.empty()) {
    Result<Roofline> loaded = Roofline::load(options.roofline);
    if (!loaded.ok()) return loaded.status();
    roofline = std::move(*loaded);
  }
  const auto precisions = choose_precisions(options);
  if (!precisions.ok()) return precisions.status();

  std::vector<BenchLane> lanes;
  FirstFrame first;
  uint64_t peak_bytes = 0;
  std::unique_ptr<RenderedFrame> frame;
  for (const std::optional<Precision> precision : *precisions) {
    const uint32_t all = renderer_options->threads;
    for (const uint32_t threads : std::set<uint32_t>{options.hz > 0 ? all : 1, all}) {
      RendererOptions own = *renderer_options;
      own.threads = threads;
      FirstFrame again;
      Result<BenchLane> lane =
          BenchLane::open(*subject, own, precision, lanes.empty() ? first : again);
      if (!lane.ok()) return lane.status();
      if (!frame) frame = std::make_unique<RenderedFrame>(lane->size(), PixelFormat::kRgba8);
      for (uint32_t i = 0; i < std::min(kWarmUpFrames, subject->frames); ++i)
        FIG_RETURN_IF_ERROR(lane->render(i, *frame, false));
      // Of one renderer: the others are the bench's, not the user's.
      if (lanes.empty()) peak_bytes = peak_memory_bytes();
      lanes.push_back(std::move(*lane));
    }
  }

  nlohmann::ordered_json paced;
  if (options.hz > 0) {
    Deadlines deadlines(options.hz, ports::now_ns());
    FIG_RETURN_IF_ERROR(run_paced(lanes[0], subject->frames, *frame, deadlines));
    paced = deadlines.json();
  } else {
    FIG_RETURN_IF_ERROR(run_by_turns(lanes, subject->frames, *frame));
  }

  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  for (const BenchLane& lane : lanes) {
    runs.push_back(lane.json());
    if (!roofline) continue;
    const auto shares = roofline->shares(runs.back(), to_string(lane.isa()), lane.scene_size());
    if (!shares.ok()) return shares.status();
    runs.back()["roofline"] = *shares;
  }
  nlohmann::ordered_json json = json_header("bench");
  json["date"] = ports::date_utc();
  json["machine"] = json_machine(
      options.device, renderer_options->threads,
      runs[0]["precision"].is_null() ? "f32" : runs[0]["precision"].get<std::string>());
  json.update(describe(*subject, lanes));
  json["first_frame_ms"] = {{"total", first.open_ms + first.prepare_ms + first.render_ms},
                            {"open", first.open_ms},
                            {"prepare", first.prepare_ms},
                            {"render", first.render_ms}};
  json["peak_memory_bytes"] = peak_bytes;
  if (!paced.is_null()) json["paced"] = std::move(paced);
  json["runs"] = std::move(runs);
  if (options.device.json != "-") print_table(json);
  return write_json(options.device.json, json);
}

}  // namespace

Command add_bench_command(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  BenchSubject& subject = options->subject;
  CLI::App* command = app.add_subcommand("bench", "Measures what a frame costs on this machine");
  command
      ->add_option("avatars", subject.scene.avatars,
                   "avatar packages (.fgn), members of a population (people.fgn#NAME, "
                   "people.fgn#17), side by side; or one file of Gaussians (.ply), turned once "
                   "around")
      ->required();
  add_body_option(*command, subject.scene.body);
  add_motion_option(*command, subject.scene.motions, "the golden pose, swaying");
  command->add_option("--frames", subject.frames, "measured frames")
      ->check(ports::between(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--hz", options->hz,
                   "begin frames at ticks of this rate and count those that end after the next "
                   "tick; one precision, one number of threads; default: as fast as it goes")
      ->check(ports::between(1.0, 1000.0));
  command->add_option("--roofline", options->roofline,
                      "what this machine can do at most, by tests/bench/roofline: prints every "
                      "stage's share of it");
  options->view.add_still_to(*command);
  add_place_options(*command, subject.scene, false);
  command->add_option("--up", subject.up, "which axis of a .ply file points up")
      ->check(ports::one_of(kUpAxes))
      ->capture_default_str();
  options->device.add_to(*command);
  subject.omissions.add_to(*command);
  return {command, [options] { return run_bench(*options); }};
}

}  // namespace figurine::samples
