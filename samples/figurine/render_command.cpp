// figurine render: avatars, posed by a motion, into images or video.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/host/process.h"
#include "samples/common/camera_path.h"
#include "samples/common/device_options.h"
#include "samples/common/file_sink.h"
#include "samples/common/frame_log.h"
#include "samples/common/machine.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/figurine/commands.h"
#include "samples/figurine/contact_sheet.h"
#include "samples/figurine/shown_frames.h"

namespace figurine::samples {

namespace {

struct RenderOptions {
  SceneOptions scene;
  DeviceOptions device;
  OmissionOptions omissions;
  ViewOptions view;
  std::string frames, background;
  std::optional<double> frames_per_second;
  std::vector<std::string> outputs;
  std::string contact_sheet;
  std::optional<uint32_t> turntable;
  ContactSheet::Options sheet;
};

// Everything that the command line said, checked and loaded.
struct Job {
  Scene scene;
  ShownFrames shown;
  CameraPathOptions camera_path;
  std::optional<std::array<float, 3>> background;
};

bool any_of(const std::vector<std::string>& outputs, bool (*is)(const std::string&)) {
  return std::any_of(outputs.begin(), outputs.end(), is);
}

// Nothing is written over something else that this command writes. By names: two of one file are
// not found out.
Status check_names(const RenderOptions& options, std::span<const uint32_t> frames) {
  std::set<std::string> names;
  const auto is_new = [&](const std::string& name) {
    return names.insert(std::filesystem::path(name).lexically_normal().string()).second;
  };
  for (const std::string& output : options.outputs) {
    const Result<NumberedName> numbered = NumberedName::parse(output);
    if (!numbered.ok()) return numbered.status();
    if (!numbered->numbered() && !is_new(output))
      return Status(StatusCode::kInvalidArgument, output + ": is written twice");
    for (const uint32_t frame : frames) {
      if (!numbered->numbered() || is_new(numbered->name(frame))) continue;
      return Status(StatusCode::kInvalidArgument,
                    numbered->name(frame) +
                        ": is written twice; with --fps above the motion's, frames repeat");
    }
  }
  if (options.contact_sheet.empty()) return {};
  FIG_RETURN_IF_ERROR(check_picture_name(options.contact_sheet));
  if (is_new(options.contact_sheet)) return {};
  return Status(StatusCode::kInvalidArgument,
                options.contact_sheet + ": the contact sheet would take the result's place");
}

Result<Job> prepare(const RenderOptions& options) {
  if (options.outputs.empty() && options.contact_sheet.empty()) {
    return Status(StatusCode::kInvalidArgument,
                  "render: nothing to write; give -o or --contact-sheet");
  }
  for (const std::string& output : options.outputs) {
    if (!output.starts_with("/dev/video")) continue;
    return Status(StatusCode::kUnsupported,
                  output + ": a video device shows what figurine live draws");
  }
  Result<Background> background =
      parse_background(options.background.empty() ? "alpha" : options.background);
  if (!background.ok()) return background.status();
  if (options.background.empty() &&
      (any_of(options.outputs, needs_background) || needs_background(options.contact_sheet))) {
    background->colour = kPlainBackground;
  }

  SceneOptions wanted = options.scene;
  wanted.open = options.device.open_options();
  Result<Scene> scene = Scene::load(wanted);
  if (!scene.ok()) return scene.status();
  // One image of a motion is its first frame, unless a frame is named; a sequence is all of it.
  const auto is_sequence = [](const std::string& output) {
    return output.find('%') != std::string::npos || is_video_name(output);
  };
  const bool one_image = options.contact_sheet.empty() && !any_of(options.outputs, is_sequence);
  const Result<FrameRange> range = parse_frames(!options.frames.empty() ? options.frames
                                                : one_image             ? "0"
                                                                        : ":");
  if (!range.ok()) return range.status();
  Result<std::vector<uint32_t>> frames = scene->frames(*range);
  if (!frames.ok()) return frames.status();

  const double rate_hz = scene->frames_per_second() / range->step;
  ShownFrames shown =
      options.turntable
          ? turntable_frames(*frames, rate_hz, options.frames_per_second, *options.turntable)
          : frames_in_time(*frames, rate_hz, options.frames_per_second);

  Result<CameraPathOptions> camera_path = options.view.camera_path();
  if (!camera_path.ok()) return camera_path.status();
  camera_path->frames_per_second = shown.frames_per_second;
  camera_path->turntable = options.turntable.has_value();
  return Job{std::move(*scene), std::move(shown), std::move(*camera_path), background->colour};
}

Status run_render(const RenderOptions& options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  Result<Job> job = prepare(options);
  if (!job.ok()) return job.status();

  Result<std::unique_ptr<Renderer>> renderer = make_renderer(*renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(job->scene.add_to(**renderer, options.device.network_precision()));
  const Result<std::vector<Camera>> cameras =
      make_camera_path(job->camera_path, job->shown.frames, job->scene, **renderer);
  if (!cameras.ok()) return cameras.status();
  const ImageSize size{cameras->front().width_px, cameras->front().height_px};
  const auto frame_count = static_cast<uint32_t>(job->shown.frames.size());
  const bool opaque = job->background.has_value();

  // A turn's pictures are numbered by themselves, others as the motion numbers them.
  const auto number = [&](uint32_t i) { return options.turntable ? i : job->shown.frames[i]; };
  std::vector<uint32_t> numbers(frame_count);
  for (uint32_t i = 0; i < frame_count; ++i) numbers[i] = number(i);
  FIG_RETURN_IF_ERROR(check_names(options, numbers));
  std::vector<std::unique_ptr<FileSink>> sinks;
  for (const std::string& output : options.outputs) {
    Result<std::unique_ptr<FileSink>> created =
        FileSink::create(output, {.size = size,
                                  .frame_count = frame_count,
                                  .frames_per_second = job->shown.frames_per_second,
                                  .opaque = opaque});
    if (!created.ok()) return created.status();
    sinks.push_back(std::move(*created));
    if (sinks.back()->format() != sinks.front()->format()) {
      return Status(StatusCode::kInvalidArgument,
                    output + ": floats and 8 bits are not written at once");
    }
  }
  const PixelFormat format = sinks.empty() ? PixelFormat::kRgba8 : sinks.front()->format();
  std::optional<ContactSheet> sheet;
  if (!options.contact_sheet.empty()) {
    ContactSheet::Options sheet_options = options.sheet;
    sheet_options.frame_size = size;
    sheet_options.frame_count = frame_count;
    Result<ContactSheet> created = ContactSheet::create(sheet_options);
    if (!created.ok()) return created.status();
    sheet = std::move(*created);
    if (format != PixelFormat::kRgba8) {
      return Status(StatusCode::kUnsupported,
                    options.outputs.front() +
                        ": a contact sheet is made beside 8-bit images or video, not .pfm");
    }
  }

  if (!job->shown.note.empty()) ports::say("render: " + job->shown.note);
  const Approximation approximation = options.omissions.approximation(job->shown.frames_per_second);
  RenderedFrame frame(size, format);
  FrameLog log;
  Progress progress("render", frame_count);
  const uint64_t start_ns = ports::now_ns();
  for (uint32_t i = 0; i < frame_count; ++i) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    const uint64_t frame_start_ns = ports::now_ns();
    FIG_RETURN_IF_ERROR((*renderer)->render({.camera = (*cameras)[i],
                                             .avatars = job->scene.pose(job->shown.frames[i]),
                                             .background = job->background,
                                             .leave_out = options.omissions.leave_out(),
                                             .approximation = approximation},
                                            frame.target()));
    log.add((*renderer)->statistics(), ports::now_ns() - frame_start_ns);
    for (const auto& sink : sinks) FIG_RETURN_IF_ERROR(sink->add(frame, numbers[i]));
    if (sheet) sheet->offer(i, frame.u8);
    progress.update(i + 1);
  }
  for (const auto& sink : sinks) FIG_RETURN_IF_ERROR(sink->finish());
  if (sheet) FIG_RETURN_IF_ERROR(sheet->write(options.contact_sheet, opaque));
  const double wall_s = static_cast<double>(ports::now_ns() - start_ns) * 1e-9;

  const std::optional<FileCamera>& camera = job->camera_path.camera.fixed;
  if (camera && !camera->said.empty()) ports::say(options.view.camera + ": " + camera->said);
  if (!options.device.json.empty()) {
    nlohmann::ordered_json json = json_header("render");
    json["avatars"] = options.scene.avatars;
    json["output"] = options.outputs.empty() ? "" : options.outputs.front();
    if (options.outputs.size() > 1) json["outputs"] = options.outputs;
    if (sheet) json["contact_sheet"] = options.contact_sheet;
    json["frames"] = frame_count;
    json["size"] = {size.width_px, size.height_px};
    json["camera"] = camera_json(cameras->front());  // of the first frame
    json["frames_per_second"] =
        1000 / std::max(log.total_ms().median, 1e-6);  // of rendering, by the median frame
    json["frames_per_second_with_output"] = frame_count / std::max(wall_s, 1e-9);
    add_json(approximation, json);
    json["keep_to_known"] = options.scene.keep_to_known;
    json["stages_ms"] = log.stages_json();
    json["work"] = log.work_json();
    json["renderer_memory_bytes"] = (*renderer)->memory_bytes();
    json["peak_memory_bytes"] = peak_memory_bytes();
    json["machine"] =
        json_machine(options.device, (*renderer)->threads(), job->scene.precision(**renderer));
    return write_json(options.device.json, json);
  }
  return {};
}

}  // namespace

Command add_render_command(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();
  CLI::App* command = app.add_subcommand("render", "Renders avatars to images or video");
  add_avatars_argument(*command, options->scene.avatars);
  add_body_option(*command, options->scene.body);
  command
      ->add_option("--motion", options->scene.motions,
                   "motion packages: one for all avatars, or one for each")
      ->expected(1)
      ->take_all();
  command
      ->add_option(
          "--pose", options->scene.poses,
          "pose files (.json, docs/poses.md) in place of a motion: one for all avatars, or "
          "one for each")
      ->expected(1)
      ->take_all();
  command->add_option("--frames", options->frames,
                      "N, A:B or A:B:STEP (B excluded); default: all, or frame 0 for one image");
  add_place_options(*command, options->scene);
  options->view.add_to(*command);
  add_background_option(*command, options->background, true, "alpha for images");
  command
      ->add_option("--fps", options->frames_per_second,
                   "frames a second, in real time: of a faster motion frames are left out, of a "
                   "slower one repeated; default: the motion's, divided by STEP")
      ->check(ports::positive());
  command
      ->add_option("--turntable", options->turntable,
                   "N frames in which an orbit goes round once; the motion starts again where it "
                   "ends, and one frame (--frames 7) stands still")
      ->check(ports::between(2, 100000));
  command->add_option("--contact-sheet", options->contact_sheet,
                      "also put evenly chosen frames into one .png or .jpg");
  command->add_option("--columns", options->sheet.columns, "of the contact sheet")
      ->check(ports::between(1, 100))
      ->capture_default_str();
  command->add_option("--tiles", options->sheet.tiles, "of the contact sheet")
      ->check(ports::between(1, 10000))
      ->capture_default_str();
  command->add_option("--sheet-shrink", options->sheet.shrink, "tiles are 1/N of a frame")
      ->check(ports::between(1, 64))
      ->capture_default_str();
  command
      ->add_option("-o,--output", options->outputs,
                   "x.png, x_%04d.png (numbered as the motion's frames), .jpg or .pfm; x.webp, "
                   "x.mp4, x.webm, x.gif or x.y4m; several are written at once")
      ->expected(1)
      ->take_all();
  options->device.add_to(*command);
  options->omissions.add_to(*command);
  return {command, [options] { return run_render(*options); }};
}

}  // namespace figurine::samples
