// figurine live: avatars in a stream until told otherwise, their pose from a motion, from standard
// input or from a performer over the network.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/camera_path.h"
#include "samples/common/device_options.h"
#include "samples/common/live_output.h"
#include "samples/common/machine.h"
#include "samples/common/vmc_feed.h"
#include "samples/figurine/commands.h"
#include "samples/figurine/live_loop.h"

namespace figurine::samples {

namespace {

struct LiveOptions {
  SceneOptions scene;
  DeviceOptions device;
  OmissionOptions omissions;
  ViewOptions view;
  std::string pose, output, background = "#dbe0e6", behind;
  double frames_per_second = 30;
  std::optional<uint64_t> frames;
  std::optional<double> seconds;
};

bool is_vmc(const std::string& pose) { return pose.starts_with("vmc:"); }

// A file that --pose names: a motion, which is a package, or a pose as text. Packages begin with a
// byte that no text begins with.
Status add_pose_file(const std::string& path, SceneOptions& scene) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status().within("pose");
  const bool package = !file->bytes().empty() && file->bytes()[0] == std::byte{0x8F};
  (package ? scene.motions : scene.poses) = {path};
  return {};
}

// What the command line says of the run, checked before anything large is loaded.
struct Plan {
  std::optional<ports::UdpAddress> address;
  CameraPathOptions camera_path;
  std::array<float, 3> background{};
  std::optional<uint64_t> ticks;
};

Result<Plan> make_plan(const LiveOptions& options) {
  const auto invalid = [](const std::string& what) {
    return Status(StatusCode::kInvalidArgument, what);
  };
  Plan plan;
  FIG_RETURN_IF_ERROR(LiveOutput::check(options.output));
  if (options.output == "-" && options.device.json == "-")
    return invalid("live: -o - and --json - cannot both have standard output");
  if (is_vmc(options.pose)) {
    const Result<ports::UdpAddress> address = ports::parse_vmc_address(options.pose);
    if (!address.ok()) return address.status();
    plan.address = *address;
  }
  const Result<Background> background = parse_background(options.background);
  if (!background.ok()) return background.status();
  if (!background->colour) {
    return invalid(
        "background 'alpha': live video has no alpha; give a colour, for a chroma key "
        "#00b140");
  }
  plan.background = *background->colour;
  Result<CameraPathOptions> camera_path = options.view.camera_path();
  if (!camera_path.ok()) return camera_path.status();
  plan.camera_path = std::move(*camera_path);
  plan.ticks = options.frames;
  if (options.seconds) {
    plan.ticks = static_cast<uint64_t>(
        std::max<long long>(1, std::llround(*options.seconds * options.frames_per_second)));
  }
  return plan;
}

Result<std::unique_ptr<PoseFeed>> open_feed(const LiveOptions& options, const Plan& plan) {
  if (options.pose == "-") {
    return std::unique_ptr<PoseFeed>(
        std::make_unique<LineFeed>(LineFeed::Options{.now_ns = ports::now_ns}));
  }
  if (!plan.address) return std::unique_ptr<PoseFeed>();
  Result<std::unique_ptr<VmcFeed>> feed =
      VmcFeed::open(*plan.address, {.state = {}, .now_ns = ports::now_ns});
  if (!feed.ok()) return feed.status();
  return std::unique_ptr<PoseFeed>(std::move(*feed));
}

// A camera from a file stays where the file has it.
bool follows(const CameraPathOptions& options) { return options.follow && !options.camera.fixed; }

// Where the camera begins. It must frame what is to come: all of a motion, else the golden pose.
Result<Camera> first_camera(const Plan& plan, Scene& scene, Renderer& renderer) {
  const Result<std::vector<uint32_t>> frames = scene.frames({});
  if (!frames.ok()) return frames.status();
  const Result<std::vector<Camera>> cameras =
      make_camera_path(plan.camera_path, *frames, scene, renderer);
  if (!cameras.ok()) return cameras.status();
  scene.pose(0);  // whose place the camera's is
  return cameras->front();
}

nlohmann::ordered_json describe(const LiveOptions& options, const LiveRun& run,
                                const LiveLoop& loop) {
  const auto quantiles = [](const LatencyHistogram& log) {
    return nlohmann::ordered_json{{"p50", log.percentile_ms(50)},
                                  {"p99", log.percentile_ms(99)},
                                  {"largest", log.largest_ms()},
                                  {"count", log.count()}};
  };
  nlohmann::ordered_json json = json_header("live");
  json["date"] = ports::date_utc();
  json["avatars"] = options.scene.avatars;
  json["pose"] = options.pose;
  json["output"] = options.output;
  json["size"] = {loop.size.width_px, loop.size.height_px};
  json["pixel_format"] = to_string(loop.sink.format());
  if (loop.behind != nullptr) {
    const Backdrop::Counts counts = loop.behind->counts();
    json["behind"] = {{"device", loop.behind->path()},
                      {"pictures", counts.pictures},
                      {"broken", counts.broken},
                      {"lost", counts.lost}};
  }
  json["frames_per_second"] = options.frames_per_second;
  json["seconds"] = run.seconds;
  json["ended_by"] = to_string(run.end);
  json["frames"] = run.ticks;
  json["shown_frames"] = loop.sink.counts().shown;
  json["late_frames"] = loop.sink.counts().late;
  json["dropped_frames"] = loop.sink.counts().dropped;
  json["latency_ms"] = quantiles(run.latency);
  json["rendering_ms"] = quantiles(run.rendering);
  json["poses"] = loop.feed == nullptr ? nlohmann::ordered_json() : loop.feed->counts();
  add_json(loop.approximation, json);
  json["keep_to_known"] = options.scene.keep_to_known;
  json["pulled_poses"] = run.pulled_poses;
  json["renderer_memory_bytes"] = loop.renderer.memory_bytes();
  json["peak_memory_bytes"] = peak_memory_bytes();
  json["machine"] =
      json_machine(options.device, loop.renderer.threads(), loop.scene.precision(loop.renderer));
  return json;
}

void print_summary(const LiveRun& run, const LiveLoop& loop) {
  char text[256];
  std::snprintf(text, sizeof(text),
                "live: %llu frames shown (%llu late), %llu dropped in %.1f s; from pose to pixels "
                "p50 %.1f ms, "
                "p99 %.1f ms",
                static_cast<unsigned long long>(loop.sink.counts().shown),
                static_cast<unsigned long long>(loop.sink.counts().late),
                static_cast<unsigned long long>(loop.sink.counts().dropped), run.seconds,
                run.latency.percentile_ms(50), run.latency.percentile_ms(99));
  ports::say(text + (loop.feed == nullptr ? "" : "; " + loop.feed->summary()));
}

Status run_live_command(LiveOptions options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  const Result<Plan> plan = make_plan(options);
  if (!plan.ok()) return plan.status();
  if (options.pose != "-" && !plan->address)
    FIG_RETURN_IF_ERROR(add_pose_file(options.pose, options.scene));
  SceneOptions wanted = options.scene;
  wanted.open = options.device.open_options();
  Result<Scene> scene = Scene::load(wanted);
  if (!scene.ok()) return scene.status();
  const Result<std::unique_ptr<PoseFeed>> opened = open_feed(options, *plan);
  if (!opened.ok()) return opened.status();
  PoseFeed* const feed = opened.value().get();
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(*renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, options.device.network_precision()));
  const Result<Camera> camera = first_camera(*plan, *scene, **renderer);
  if (!camera.ok()) return camera.status();
  const std::array<float, 3> place = mean_place(*scene);
  for (size_t f = 0; feed != nullptr && f < scene->size(); ++f) {
    Result<std::unique_ptr<PoseSource>> source = feed->source_for(scene->body(f).package.body());
    if (!source.ok()) return source.status().within(scene->avatar(f).name);
    scene->set_source(f, std::move(*source));
  }
  const ImageSize size{camera->width_px, camera->height_px};
  Result<LiveOutput> output = LiveOutput::open(
      options.output, {.size = size, .frames_per_second = options.frames_per_second});
  if (!output.ok()) return output.status();
  std::unique_ptr<Backdrop> behind;
  if (!options.behind.empty()) {
    Result<std::unique_ptr<Backdrop>> camera_behind = Backdrop::open(
        options.behind, {.size = size, .frames_per_second = options.frames_per_second});
    if (!camera_behind.ok()) return camera_behind.status().within("behind");
    behind = std::move(*camera_behind);
  }
  if (feed != nullptr) feed->start();

  LiveLoop loop{.scene = *scene,
                .renderer = **renderer,
                .sink = output->sink(),
                .behind = behind.get(),
                .feed = feed,
                .camera = FollowCamera(*camera, place, follows(plan->camera_path)),
                .size = size,
                .background = plan->background,
                .leave_out = options.omissions.leave_out(),
                .approximation = options.omissions.approximation(options.frames_per_second),
                .frames_per_second = options.frames_per_second,
                .ticks = plan->ticks};
  LiveRun run = run_live(loop);
  if (run.end == LiveEnd::kPoses && !feed->arrived_ns()) {
    run.end = LiveEnd::kError;
    run.status = Status(StatusCode::kInvalidArgument, "standard input: ended without a pose");
  }
  // An interrupt is how most runs end: what was shown stays.
  const Status finished = run.end == LiveEnd::kError ? Status() : output->finish();
  print_summary(run, loop);
  FIG_RETURN_IF_ERROR(write_json(options.device.json, describe(options, run, loop)));
  if (run.end == LiveEnd::kInterrupt)
    return finished.ok() ? Status(StatusCode::kInterrupted, "live: stopped by a signal") : finished;
  return run.status.ok() ? finished : run.status;
}

}  // namespace

Command add_live_command(CLI::App& app) {
  auto options = std::make_shared<LiveOptions>();
  CLI::App* command = app.add_subcommand(
      "live", "Shows avatars in a stream, posed as it goes, until told otherwise");
  add_avatars_argument(*command, options->scene.avatars);
  add_body_option(*command, options->scene.body);
  command
      ->add_option("--pose", options->pose,
                   "a motion (.fgn), again and again; a pose file (.json); vmc://:39539, a "
                   "performer over UDP; or -, a line of JSON or a record of bytes a pose "
                   "(docs/poses.md)")
      ->required();
  command
      ->add_option(
          "-o,--output", options->output,
          "window, - (y4m on standard output), /dev/videoN (docs/virtual_camera.md), a FIFO, or "
          "x.y4m (docs/live.md)")
      ->required();
  command->add_option("--fps", options->frames_per_second, "frames a second")
      ->check(ports::between(1.0, 240.0))
      ->capture_default_str();
  CLI::Option* frames =
      command->add_option("--frames", options->frames, "end after so many, dropped ones counted")
          ->check(ports::between(1, uint64_t{1} << 40));
  command->add_option("--seconds", options->seconds, "end after so many")
      ->check(ports::between(0.001, 1e8))
      ->excludes(frames);
  add_place_options(*command, options->scene);
  options->view.add_to(*command);
  add_background_option(*command, options->background, false, options->background);
  command->add_option("--behind", options->behind,
                      "/dev/videoN, a camera whose picture stands behind the figures in place of "
                      "the background, cut to the frame's shape");
  options->device.add_to(*command);
  options->omissions.add_to(*command);
  return {command, [options] { return run_live_command(*options); }};
}

}  // namespace figurine::samples
