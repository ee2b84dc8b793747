// figurine splat: any file of 3D Gaussians, into one image.
#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/camera_spec.h"
#include "samples/common/device_options.h"
#include "samples/common/file_sink.h"
#include "samples/common/frame_log.h"
#include "samples/common/gaussian_scene.h"
#include "samples/common/machine.h"
#include "samples/common/rendered_frame.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

constexpr const char* kUpOfTheFile = "auto";

struct SplatCommandOptions {
  std::string scene, camera, size, background, up = kUpOfTheFile, output;
  std::optional<float> near_m;
  float alpha_cut = kAlphaCut;
  std::optional<bool> antialiased;  // none: as the file says
  DeviceOptions device;
};

Result<Camera> choose_camera(const SplatCommandOptions& options, const CameraSpec& spec,
                             const GaussianCloud& cloud) {
  std::optional<ImageSize> size;
  if (!options.size.empty()) {
    const Result<ImageSize> parsed = parse_size(options.size);
    if (!parsed.ok()) return parsed.status();
    size = *parsed;
  }
  Result<Camera> camera = Status(StatusCode::kInvalidArgument, "camera");
  if (spec.fixed) {
    camera = fixed_camera(*spec.fixed, size, kSceneSize, cloud.origin_m);
  } else {
    const ImageSize wanted = size.value_or(kSceneSize);
    camera = scene_camera(orbit_scene(cloud, spec.orbit, options.up, wanted), options.up, wanted);
  }
  if (!camera.ok()) return camera;
  if (options.near_m) camera->near_m = *options.near_m;
  FIG_RETURN_IF_ERROR(validate_camera(*camera));
  return camera;
}

// What was read and taken for granted, a line each for file and camera.
void say_what_was_read(const SplatCommandOptions& options, const GaussianCloud& cloud,
                       const CameraSpec& spec, uint64_t visible) {
  ports::say(options.scene + ": " + ports::describe(cloud));
  if (spec.fixed && !spec.fixed->said.empty()) ports::say(options.camera + ": " + spec.fixed->said);
  if (visible == 0) ports::say(options.scene + ": no Gaussian is in the picture");
}

Status run_splat(SplatCommandOptions options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  Result<Background> background =
      parse_background(options.background.empty() ? "alpha" : options.background);
  if (!background.ok()) return background.status();
  if (options.background.empty() && needs_background(options.output))
    background->colour = kPlainBackground;
  if (!options.output.starts_with("/dev/video") && is_video_name(options.output)) {
    return Status(StatusCode::kUnsupported,
                  options.output + ": a scene does not move; write .png, .jpg or .pfm");
  }

  CameraSpec spec;
  if (!options.camera.empty()) {
    Result<CameraSpec> parsed = parse_camera_spec(options.camera);
    if (!parsed.ok()) return parsed.status();
    spec = std::move(*parsed);
  }
  Result<GaussianCloud> cloud = read_scene(options.scene);
  if (!cloud.ok()) return cloud.status();
  if (options.up != kUpOfTheFile) cloud->up = ports::parse_up_axis(options.up);
  options.up = to_string(cloud->up_axis());
  cloud->antialiased = options.antialiased.value_or(cloud->antialiased);
  const Result<Camera> camera = choose_camera(options, spec, *cloud);
  if (!camera.ok()) return camera.status();
  const ImageSize size{camera->width_px, camera->height_px};
  Result<std::unique_ptr<FileSink>> sink = FileSink::create(
      options.output, {.size = size, .frame_count = 1, .opaque = background->colour.has_value()});
  if (!sink.ok()) return sink.status();

  Result<std::unique_ptr<Renderer>> renderer = make_renderer(*renderer_options);
  if (!renderer.ok()) return renderer.status();
  RenderedFrame frame(size, (*sink)->format());
  const GaussianView gaussians[] = {cloud->view()};
  FrameLog log;
  const uint64_t start_ns = ports::now_ns();
  FIG_RETURN_IF_ERROR((*renderer)->render(
      {.camera = *camera,
       .gaussians = gaussians,
       .background = background->colour,
       .splat = {.alpha_cut = options.alpha_cut, .antialiased = cloud->antialiased}},
      frame.target()));
  log.add((*renderer)->statistics(), ports::now_ns() - start_ns);
  FIG_RETURN_IF_ERROR((*sink)->add(frame, 0));
  FIG_RETURN_IF_ERROR((*sink)->finish());

  say_what_was_read(options, *cloud, spec, (*renderer)->statistics().visible);
  if (!options.device.json.empty()) {
    nlohmann::ordered_json json = json_header("splat");
    json["scene"] = options.scene;
    json["output"] = options.output;
    json["gaussians"] = cloud->count();
    json["left_out"] = cloud->left_out;
    json["sh_degree"] = cloud->sh_degree;
    json["container"] = cloud->container;
    json["antialiased"] = cloud->antialiased;
    json["up"] = options.up;
    json["origin"] = cloud->origin_m;
    json["remarks"] = cloud->remarks;
    json["size"] = {size.width_px, size.height_px};
    json["camera"] = camera_json(*camera);
    json["stages_ms"] = log.stages_json();
    json["work"] = log.work_json();
    json["peak_memory_bytes"] = peak_memory_bytes();
    json["machine"] =
        json_machine(options.device, (*renderer)->threads(), to_string(Precision::kFloat32));
    return write_json(options.device.json, json);
  }
  return {};
}

std::vector<std::string> up_choices() {
  std::vector<std::string> choices = kUpAxes;
  choices.insert(choices.begin(), kUpOfTheFile);
  return choices;
}

}  // namespace

Command add_splat_command(CLI::App& app) {
  auto options = std::make_shared<SplatCommandOptions>();
  CLI::App* command = app.add_subcommand("splat", "Renders a file of 3D Gaussians");
  command
      ->add_option("scene", options->scene,
                   "Gaussians: .ply of 3DGS and its kin, compressed .ply, .splat, .spz")
      ->required();
  add_camera_option(*command, options->camera, "the whole scene from the front");
  command
      ->add_option("--up", options->up,
                   "which axis of the file points up, for orbits: +y, -y, +z, -z, +x or -x; auto: "
                   "as the file says, or -y")
      ->check(ports::one_of(up_choices()))
      ->capture_default_str();
  add_near_option(*command, options->near_m,
                  "0.2, of a camera near the scene a tenth of its distance");
  command
      ->add_option("--alpha-cut", options->alpha_cut,
                   "contributions below it are skipped; default 1/255")
      ->check(ports::between(1e-9, 0.5));
  command->add_flag("--antialiased,!--no-antialiased", options->antialiased,
                    "for scenes that were trained with Mip-Splatting's 2D filter (gsplat: "
                    "rasterize_mode antialiased, eps2d 0.1); default: as the file's comments say");
  add_size_option(*command, options->size, "the camera's, or 1024x768");
  add_background_option(*command, options->background, true, "alpha, of .jpg a light grey");
  command->add_option("-o,--output", options->output, "x.png, x.jpg or x.pfm")->required();
  options->device.add_to(*command, {.precision = true});  // there is no network
  return {command, [options] { return run_splat(*options); }};
}

}  // namespace figurine::samples
