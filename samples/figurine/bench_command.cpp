// figurine bench: what a frame costs on this machine, stage by stage, in every precision that the
// package holds, on one thread and on several. Every frame has a fresh pose and a run of the
// network.
//
// Precisions and thread counts take turns frame by frame, so that whatever else the machine does
// falls on all of them alike; medians are compared, not means.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "samples/common/camera_path.h"
#include "samples/common/device_options.h"
#include "samples/common/frame_log.h"
#include "samples/common/machine.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/figurine/allocation_counter.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

constexpr uint32_t kWarmUpFrames = 3;

struct BenchOptions {
  SceneOptions scene;
  DeviceOptions device;
  Approximation approximation;
  std::string size, json;
  uint32_t frames = 60;
};

// One renderer with its own copy of the scene and what its frames cost.
struct Lane {
  Precision precision = Precision::kFloat32;
  uint32_t threads = 1;
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<Scene> scene;
  std::vector<uint32_t> frames;
  std::vector<Camera> cameras;
  Approximation approximation;
  FrameLog log;
  uint64_t allocations = 0;

  std::span<const FrameAvatar> pose(uint32_t i) {
    return scene->moves() ? scene->pose(frames[i % frames.size()]) : scene->sway(i);
  }
  Status render(uint32_t i, RenderedFrame& frame, bool measured) {
    const std::span<const FrameAvatar> posed = pose(i);
    if (measured) start_counting_allocations();
    const uint64_t start_ns = ports::now_ns();
    // A pose that comes again has its run all the same.
    const Status status = renderer->render({.camera = cameras[i % cameras.size()],
                                            .avatars = posed,
                                            .leave_out = {.unchanged_networks = false},
                                            .approximation = approximation},
                                           frame.target());
    const uint64_t total_ns = ports::now_ns() - start_ns;
    if (measured) {
      allocations += stop_counting_allocations();
      log.add(renderer->statistics(), total_ns);
    }
    return status;
  }
};

struct FirstFrame {
  double open_ms = 0, prepare_ms = 0, render_ms = 0;
};

double ms_since(uint64_t start_ns) {
  return static_cast<double>(ports::now_ns() - start_ns) * 1e-6;
}

// From closed files to the first picture, by the golden pose and camera.
Status open_lane(const BenchOptions& options, RendererOptions renderer_options, Lane& lane,
                 FirstFrame& first) {
  uint64_t start_ns = ports::now_ns();
  Result<Scene> scene = Scene::load(options.scene);
  if (!scene.ok()) return scene.status();
  lane.scene = std::make_unique<Scene>(std::move(*scene));
  first.open_ms = ms_since(start_ns);
  start_ns = ports::now_ns();
  renderer_options.threads = lane.threads;
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(renderer_options);
  if (!renderer.ok()) return renderer.status();
  lane.renderer = std::move(*renderer);
  FIG_RETURN_IF_ERROR(lane.scene->add_to(*lane.renderer, lane.precision));
  first.prepare_ms = ms_since(start_ns);
  const Camera& camera = lane.scene->avatar(0).avatar.golden.camera;
  RenderedFrame frame({camera.width_px, camera.height_px}, PixelFormat::kRgba8);
  start_ns = ports::now_ns();
  FIG_RETURN_IF_ERROR(
      lane.renderer->render({.camera = camera, .avatars = lane.scene->pose(0)}, frame.target()));
  first.render_ms = ms_since(start_ns);
  return {};
}

// What is asked for; otherwise all that the avatar holds, the renderer's own choice first.
Result<std::vector<Precision>> choose_precisions(const BenchOptions& options) {
  if (const std::optional<Precision> asked = options.device.network_precision())
    return std::vector<Precision>{*asked};
  const Result<std::unique_ptr<LoadedAvatar>> avatar = load_avatar(options.scene.avatars[0]);
  if (!avatar.ok()) return avatar.status();
  std::vector<Precision> precisions;
  for (const Precision precision : {Precision::kFixedPoint, Precision::kFloat32}) {
    if ((*avatar)->avatar.holds(precision)) precisions.push_back(precision);
  }
  return precisions;
}

nlohmann::ordered_json lane_json(const Lane& lane) {
  nlohmann::ordered_json json = {{"threads", lane.threads},
                                 {"precision", to_string(lane.precision)}};
  json["frames_per_second"] = 1000 / std::max(lane.log.total_ms().median, 1e-6);
  json["stages_ms"] = lane.log.stages_json();
  json["work"] = lane.log.work_json();
  json["allocations_per_frame"] =
      can_count_allocations() ? nlohmann::ordered_json(static_cast<double>(lane.allocations) /
                                                       static_cast<double>(lane.log.frames()))
                              : nullptr;
  json["renderer_memory_bytes"] = lane.renderer->memory_bytes();
  return json;
}

void print_table(const nlohmann::ordered_json& json) {
  const auto& lanes = json["runs"];
  std::printf("%s, %s\n", json["machine"]["cpu"].get<std::string>().c_str(),
              json["date"].get<std::string>().c_str());
  std::printf("%u frames of %ux%u, a fresh pose each; milliseconds, median (90th percentile)\n\n",
              json["frames"].get<uint32_t>(), json["size"][0].get<uint32_t>(),
              json["size"][1].get<uint32_t>());
  std::printf("%-12s", "precision");
  for (const auto& lane : lanes) std::printf("%20s", lane["precision"].get<std::string>().c_str());
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
  std::printf(
      "memory: renderer %.1f MB, process peak %.1f MB; packages: avatar %.2f MB, body %.2f MB\n",
      lanes[0]["renderer_memory_bytes"].get<double>() * 1e-6,
      json["peak_memory_bytes"].get<double>() * 1e-6, json["avatar_bytes"].get<double>() * 1e-6,
      json["body_bytes"].get<double>() * 1e-6);
  if (!lanes[0]["allocations_per_frame"].is_null()) {
    std::printf("allocations a frame:");
    for (const auto& lane : lanes)
      std::printf(" %.2f (%s, %u threads)", lane["allocations_per_frame"].get<double>(),
                  lane["precision"].get<std::string>().c_str(), lane["threads"].get<uint32_t>());
    std::printf("\n");
  }
}

Status run_bench(const BenchOptions& options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  CameraPathOptions camera_path;
  if (!options.size.empty()) {
    const Result<ImageSize> size = parse_size(options.size);
    if (!size.ok()) return size.status();
    camera_path.size = *size;
  }

  const Result<std::vector<Precision>> precisions = choose_precisions(options);
  if (!precisions.ok()) return precisions.status();
  std::vector<Lane> lanes;
  FirstFrame first;
  uint64_t peak_bytes = 0;
  std::vector<std::pair<Precision, uint32_t>> ways;
  for (const Precision precision : *precisions) {
    ways.emplace_back(precision, 1);
    if (renderer_options->threads > 1) ways.emplace_back(precision, renderer_options->threads);
  }
  std::unique_ptr<RenderedFrame> frame;
  for (const auto& [precision, threads] : ways) {
    Lane lane;
    lane.precision = precision;
    lane.threads = threads;
    lane.approximation = options.approximation;
    FirstFrame again;
    FIG_RETURN_IF_ERROR(open_lane(options, *renderer_options, lane, lanes.empty() ? first : again));
    Result<std::vector<uint32_t>> frames = lane.scene->frames({});
    if (!frames.ok()) return frames.status();
    lane.frames = std::move(*frames);
    if (lane.frames.size() > options.frames) lane.frames.resize(options.frames);
    Result<std::vector<Camera>> cameras =
        make_camera_path(camera_path, lane.frames, *lane.scene, *lane.renderer);
    if (!cameras.ok()) return cameras.status();
    lane.cameras = std::move(*cameras);
    if (!frame)
      frame = std::make_unique<RenderedFrame>(
          ImageSize{lane.cameras[0].width_px, lane.cameras[0].height_px}, PixelFormat::kRgba8);
    for (uint32_t i = 0; i < std::min(kWarmUpFrames, options.frames); ++i)
      FIG_RETURN_IF_ERROR(lane.render(i, *frame, false));
    if (lanes.empty())
      peak_bytes =
          peak_memory_bytes();  // of one renderer; the second one is the bench's, not the user's
    lanes.push_back(std::move(lane));
  }

  Progress progress("bench", options.frames);
  for (uint32_t i = 0; i < options.frames; ++i) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    for (size_t turn = 0; turn < lanes.size(); ++turn)
      FIG_RETURN_IF_ERROR(lanes[(i + turn) % lanes.size()].render(i, *frame, true));
    progress.update(i + 1);
  }

  nlohmann::ordered_json json = json_header("bench");
  json["date"] = ports::date_utc();
  json["machine"] =
      json_machine(options.device, renderer_options->threads, to_string(lanes[0].precision));
  json["avatar"] = options.scene.avatars[0];
  json["avatar_bytes"] = lanes[0].scene->avatar(0).package->package.size_bytes();
  json["body_bytes"] = lanes[0].scene->body(0).package.size_bytes();
  json["motion"] = options.scene.motions.empty() ? nlohmann::ordered_json()
                                                 : nlohmann::ordered_json(options.scene.motions[0]);
  json["frames"] = options.frames;
  json["network_below_px"] = options.approximation.network_below_px;
  json["size"] = {lanes[0].cameras[0].width_px, lanes[0].cameras[0].height_px};
  json["first_frame_ms"] = {{"total", first.open_ms + first.prepare_ms + first.render_ms},
                            {"open", first.open_ms},
                            {"prepare", first.prepare_ms},
                            {"render", first.render_ms}};
  json["peak_memory_bytes"] = peak_bytes;
  json["runs"] = nlohmann::ordered_json::array();
  for (const Lane& lane : lanes) json["runs"].push_back(lane_json(lane));
  if (options.json == "-") {
    print_json(json);
  } else {
    print_table(json);
    if (!options.json.empty()) {
      const std::string text =
          json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
      FIG_RETURN_IF_ERROR(
          ports::write_file_atomically(options.json, std::as_bytes(std::span(text))));
    }
  }
  return {};
}

}  // namespace

Command add_bench_command(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command = app.add_subcommand("bench", "Measures what a frame costs on this machine");
  options->scene.avatars.resize(1);
  command
      ->add_option(
          "avatar", options->scene.avatars[0],
          "avatar package (.fgn), or a member of a population (people.fgn#NAME, people.fgn#17)")
      ->required();
  command->add_option("--body", options->scene.body,
                      "body package; default: found by content hash beside the avatar, in "
                      "FIGURINE_PATH, in the folders beside");
  command
      ->add_option("--motion", options->scene.motions,
                   "motion package; default: the golden pose, swaying")
      ->expected(1);
  command->add_option("--frames", options->frames, "measured frames")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  command->add_option("--size", options->size, "WIDTHxHEIGHT; default: the golden frame's");
  options->device.add_to(*command, false);
  add_options(*command, options->approximation);
  command->add_option("--json", options->json,
                      "write the figures to this file; - prints them instead of the table");
  return {command, [options] { return run_bench(*options); }};
}

}  // namespace figurine::samples
