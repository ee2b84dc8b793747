// figurine export: an avatar in one pose, or any file of 3D Gaussians that is read, as a plain .ply
// for any standard viewer.
#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/values.h"
#include "ports/gaussians/gaussian_file.h"
#include "ports/gaussians/ply.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/device_options.h"
#include "samples/common/gaussian_scene.h"
#include "samples/common/scene.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

constexpr const char* kAntialiasedComment =
    "antialiased: trained with Mip-Splatting's 2D filter; draw with it (gsplat's rasterize_mode "
    "antialiased with eps2d 0.1)";

struct ExportOptions {
  SceneOptions scene;
  uint32_t frame = 0;
  std::string output;
  DeviceOptions device;
};

std::vector<std::string> comments_of(bool antialiased, std::optional<ports::UpAxis> up) {
  std::vector<std::string> comments = ports::drawing_comments(antialiased, up);
  if (antialiased) comments.emplace_back(kAntialiasedComment);
  return comments;
}

// From one container into the plainest: what was fused stays so, positions keep their digits.
Status export_gaussians(const ExportOptions& options) {
  const std::string& input = options.scene.avatars[0];
  if (!options.scene.body.empty() || !options.scene.motions.empty() || options.frame != 0) {
    return Status(StatusCode::kInvalidArgument,
                  input + ": a file of Gaussians has neither --body, --motion nor --frame");
  }
  const Result<GaussianCloud> cloud = read_scene(input);
  if (!cloud.ok()) return cloud.status();
  const std::vector<std::byte> bytes = ports::write_gaussian_ply(
      cloud->view(),
      {.comments = comments_of(cloud->antialiased, cloud->up), .origin_m = cloud->origin_m});
  FIG_RETURN_IF_ERROR(ports::write_file_atomically(options.output, bytes));
  ports::say(input + ": " + ports::describe(*cloud));
  if (!options.device.json.empty()) {
    nlohmann::ordered_json json = json_header("export");
    json["scene"] = input;
    json["output"] = options.output;
    json["gaussians"] = cloud->count();
    json["left_out"] = cloud->left_out;
    json["sh_degree"] = cloud->sh_degree;
    json["container"] = cloud->container;
    json["antialiased"] = cloud->antialiased;
    json["up"] = to_string(cloud->up_axis());
    json["origin"] = cloud->origin_m;
    json["size_bytes"] = bytes.size();
    return write_json(options.device.json, json);
  }
  return {};
}

Status run_export(const ExportOptions& options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  if (!options.output.ends_with(".ply"))
    return Status(StatusCode::kUnsupported, options.output + ": Gaussians are exported as .ply");
  if (ports::is_gaussian_name(options.scene.avatars[0])) return export_gaussians(options);
  SceneOptions wanted = options.scene;
  wanted.open = options.device.open_options();
  Result<Scene> scene = Scene::load(wanted);
  if (!scene.ok()) return scene.status();
  const Result<std::vector<uint32_t>> frames =
      scene->frames({.first = options.frame, .end = options.frame + 1});
  if (!frames.ok()) return frames.status();
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(*renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, options.device.network_precision()));
  const FrameAvatar posed = scene->pose(options.frame)[0];
  const Result<GaussianView> gaussians = (*renderer)->pose_avatar(posed.avatar, posed.pose);
  if (!gaussians.ok()) return gaussians.status();
  // Smallest extents are in the scales and opacities; of the filter in the picture files have no
  // word but their comments.
  const bool antialiased = scene->avatar(0).avatar.antialiased;
  const std::vector<std::byte> bytes = ports::write_gaussian_ply(
      *gaussians, {.comments = comments_of(antialiased, ports::UpAxis::kPlusY)});
  FIG_RETURN_IF_ERROR(ports::write_file_atomically(options.output, bytes));
  ports::say(options.output + ": " + std::to_string(gaussians->count) + " Gaussians of degree " +
             std::to_string(gaussians->sh_degree) + (antialiased ? ", antialiased" : "") +
             ", up +y");
  if (!options.device.json.empty()) {
    nlohmann::ordered_json json = json_header("export");
    json["avatar"] = options.scene.avatars[0];
    json["output"] = options.output;
    json["frame"] = options.frame;
    json["precision"] = scene->precision(**renderer);
    json["gaussians"] = gaussians->count;
    json["sh_degree"] = gaussians->sh_degree;
    json["antialiased"] = antialiased;
    json["size_bytes"] = bytes.size();
    return write_json(options.device.json, json);
  }
  return {};
}

}  // namespace

Command add_export_command(CLI::App& app) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command =
      app.add_subcommand("export", "Writes an avatar in one pose, or a scene, as .ply Gaussians");
  options->scene.avatars.resize(1);
  command
      ->add_option(
          "avatar", options->scene.avatars[0],
          "avatar package (.fgn), a member of a population (people.fgn#NAME, people.fgn#17), or "
          "a file of Gaussians (.ply, .splat, .spz)")
      ->required();
  add_body_option(*command, options->scene.body);
  add_motion_option(*command, options->scene.motions, "the golden pose");
  command
      ->add_option("--pose", options->scene.poses,
                   "pose file (.json, docs/poses.md) in place of a motion")
      ->expected(1);
  command->add_option("--frame", options->frame, "of the motion")
      ->check(ports::between(0, UINT32_MAX - 1))
      ->capture_default_str();
  command->add_option("-o,--output", options->output, "x.ply")->required();
  options->device.add_to(*command);
  return {command, [options] { return run_export(*options); }};
}

}  // namespace figurine::samples
