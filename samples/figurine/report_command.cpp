// figurine report: every speed-up as a point of error over run time, of avatars here and of
// samplers in sampler_report.cpp. One table of dials; each setting is rendered for the same frames
// in turn and held against the reference setting's pictures.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <format>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/media/png.h"
#include "samples/common/camera_path.h"
#include "samples/common/device_options.h"
#include "samples/common/frame_log.h"
#include "samples/common/image_error.h"
#include "samples/common/loading.h"
#include "samples/common/machine.h"
#include "samples/common/pose_rarity.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/figurine/commands.h"
#include "samples/figurine/report_dials.h"
#include "samples/figurine/report_files.h"
#include "samples/figurine/report_page.h"
#include "samples/figurine/sampler_report.h"

namespace figurine::samples {

namespace {

constexpr const char* kReferenceMeaning =
    "the same renderer with the alpha cut at 1e-7: every contribution that float arithmetic can "
    "tell from nothing is blended. The "
    "transmittance stop at 1e-4 "
    "and the dilation of a Gaussian by part of a pixel are part of the definition of the picture "
    "and the same "
    "everywhere.";

struct ReportOptions {
  SceneOptions scene;
  DeviceOptions device;
  std::string size, output;
  uint32_t frames = 16;
  uint32_t seeds = 4;
};

struct Measurement {
  ErrorSum error;
  FrameLog log;
};

// A renderer with its own copy of the scene, in one precision.
struct SceneRenderer {
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<Scene> scene;
};

Result<SceneRenderer> make_scene_renderer(const SceneOptions& options,
                                          const RendererOptions& renderer_options,
                                          std::optional<Precision> precision) {
  Result<Scene> scene = Scene::load(options);
  if (!scene.ok()) return scene.status();
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, precision));
  return SceneRenderer{std::move(*renderer), std::make_unique<Scene>(std::move(*scene))};
}

// Draws frame number i of the run with any setting.
class SettingRenderer {
 public:
  // floats: for settings that ask for f32, where the first has another precision; may be
  // empty.
  SettingRenderer(SceneRenderer first, SceneRenderer floats, std::vector<uint32_t> frames,
                  std::vector<Camera> cameras)
      : first_(std::move(first)),
        floats_(std::move(floats)),
        frames_(std::move(frames)),
        cameras_(std::move(cameras)) {}

  Status draw(uint32_t i, const Knobs& knobs, RenderedFrame& picture) {
    SceneRenderer& used = renderer_of(knobs);
    const std::span<const FrameAvatar> posed =
        used.scene->moves() ? used.scene->pose(frames_[i % frames_.size()]) : used.scene->sway(i);
    // Every setting pays for its network, whichever drew the pose before it.
    LeaveOut leave_out = knobs.leave_out;
    leave_out.unchanged_networks = false;
    return used.renderer->render({.camera = cameras_[i % cameras_.size()],
                                  .avatars = posed,
                                  .splat = knobs.splat,
                                  .leave_out = leave_out,
                                  .approximation = knobs.approximation},
                                 picture.target());
  }
  Status measure(uint32_t i, const Setting& setting, const RenderedFrame& truth, RenderedFrame& u8,
                 RenderedFrame& f32, Measurement& result) {
    FIG_RETURN_IF_ERROR(draw(i, setting.knobs, f32));
    add_foreground_error(truth.f32, f32.f32, result.error);
    const uint64_t start_ns =
        ports::now_ns();  // timed by itself, into the 8-bit picture that a user sees
    FIG_RETURN_IF_ERROR(draw(i, setting.knobs, u8));
    result.log.add(statistics(setting.knobs), ports::now_ns() - start_ns);
    return {};
  }
  const FrameStatistics& statistics(const Knobs& knobs) {
    return renderer_of(knobs).renderer->statistics();
  }
  ImageSize size() const { return {cameras_[0].width_px, cameras_[0].height_px}; }

 private:
  SceneRenderer& renderer_of(const Knobs& knobs) {
    return knobs.precision == Precision::kFloat32 && floats_.renderer != nullptr ? floats_ : first_;
  }

  SceneRenderer first_, floats_;
  std::vector<uint32_t> frames_;
  std::vector<Camera> cameras_;
};

// A setting of a dial whose pictures depend on the frames before: one renderer for pictures that
// are held against the truth and one that is timed, because a pose drawn twice counts twice.
struct SequenceRenderers {
  SettingRenderer pictures, timed;
};

FrameStatistics mean_of(std::span<const FrameStatistics> frames) {
  FrameStatistics mean;
  const auto take = [&](auto member) {
    uint64_t sum = 0;
    for (const FrameStatistics& frame : frames) sum += frame.*member;
    mean.*member = sum / frames.size();
  };
  for (size_t s = 0; s < kStageCount; ++s) {
    for (const FrameStatistics& frame : frames) mean.stage_ns[s] += frame.stage_ns[s];
    mean.stage_ns[s] /= frames.size();
  }
  for (const auto member :
       {&FrameStatistics::gaussians, &FrameStatistics::visible, &FrameStatistics::pairs,
        &FrameStatistics::blends, &FrameStatistics::macs})
    take(member);
  return mean;
}

// Frames 0, 1, ... of the renderers: first one sequence that nobody looks at, in which every
// setting gets a past; then count frames, of which each sequence is one entry of a log.
Status measure_sequences(const Dial& dial, SettingRenderer& reference,
                         std::span<SequenceRenderers> settings, uint32_t count,
                         std::vector<Measurement>& results) {
  RenderedFrame truth(reference.size(), PixelFormat::kRgbaF32),
      f32(reference.size(), PixelFormat::kRgbaF32), u8(reference.size(), PixelFormat::kRgba8);
  std::vector<std::vector<FrameStatistics>> statistics(settings.size());
  std::vector<uint64_t> total_ns(settings.size(), 0);
  for (uint32_t i = 0; i < dial.sequence + count; ++i) {
    FIG_RETURN_IF_ERROR(reference.draw(i, dial.reference, truth));
    for (size_t turn = 0; turn < settings.size(); ++turn) {
      FIG_RETURN_IF_ERROR(check_interrupt());
      const size_t s = (i + turn) % settings.size();
      const Knobs& knobs = dial.settings[s].knobs;
      FIG_RETURN_IF_ERROR(settings[s].pictures.draw(i, knobs, f32));
      const uint64_t start_ns = ports::now_ns();
      FIG_RETURN_IF_ERROR(settings[s].timed.draw(i, knobs, u8));
      const uint64_t frame_ns = ports::now_ns() - start_ns;
      if (i < dial.sequence) continue;
      add_foreground_error(truth.f32, f32.f32, results[s].error);
      statistics[s].push_back(settings[s].timed.statistics(knobs));
      total_ns[s] += frame_ns;
      if (statistics[s].size() < dial.sequence) continue;
      results[s].log.add(mean_of(statistics[s]), total_ns[s] / dial.sequence);
      statistics[s].clear();
      total_ns[s] = 0;
    }
  }
  return {};
}

struct Box {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// Where the picture has something, with a little room.
Box foreground_box(const ports::ImageF32& image) {
  Box box{image.width_px, image.height_px, 0, 0};
  for (uint32_t y = 0; y < image.height_px; ++y) {
    for (uint32_t x = 0; x < image.width_px; ++x) {
      if (!(image.at(x, y)[3] > 0.02f)) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1),
             std::max(box.y1, y + 1)};
    }
  }
  if (box.x1 <= box.x0) return {0, 0, image.width_px, image.height_px};
  constexpr uint32_t kRoom = 8;
  return {box.x0 - std::min(box.x0, kRoom), box.y0 - std::min(box.y0, kRoom),
          std::min(box.x1 + kRoom, image.width_px), std::min(box.y1 + kRoom, image.height_px)};
}

// The box of grey + gain * (picture - truth) over grey; gain 0 shows the truth itself over grey.
Result<std::vector<std::byte>> draw_difference(const ports::ImageF32& truth,
                                               const ports::ImageF32& picture, const Box& box,
                                               float gain) {
  ports::ImageU8 image(box.x1 - box.x0, box.y1 - box.y0, 3);
  for (uint32_t y = box.y0; y < box.y1; ++y) {
    for (uint32_t x = box.x0; x < box.x1; ++x) {
      const float* t = truth.at(x, y);
      const float* p = picture.at(x, y);
      for (int c = 0; c < 3; ++c) {
        const float over_truth = (t[c] - 0.5f) * t[3],
                    difference = (p[c] - 0.5f) * p[3] - over_truth;
        const float value = 0.5f + (gain == 0 ? over_truth : gain * difference);
        image.at(x - box.x0, y - box.y0)[c] =
            static_cast<uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255));
      }
    }
  }
  return ports::encode_png(image);
}

// The truth and the differences of a coarse setting, the default and a fine one, for one frame.
Status draw_pictures(SettingRenderer& drawing, uint32_t frame, const Dial& dial,
                     std::vector<ReportPicture>& pictures) {
  constexpr float kGain = 32;
  RenderedFrame truth(drawing.size(), PixelFormat::kRgbaF32),
      picture(drawing.size(), PixelFormat::kRgbaF32);
  FIG_RETURN_IF_ERROR(drawing.draw(frame, dial.reference, truth));
  const Box box = foreground_box(truth.f32);
  Result<std::vector<std::byte>> png = draw_difference(truth.f32, truth.f32, box, 0);
  if (!png.ok()) return png.status();
  pictures.push_back({"the reference", std::move(*png)});
  for (size_t s = 0; s < dial.settings.size(); ++s) {
    const Setting& setting = dial.settings[s];
    if (!setting.is_default && s != 1 && s + 2 != dial.settings.size()) continue;
    FIG_RETURN_IF_ERROR(drawing.draw(frame, setting.knobs, picture));
    png = draw_difference(truth.f32, picture.f32, box, kGain);
    if (!png.ok()) return png.status();
    pictures.push_back({dial.name + " " + setting.label + (setting.is_default ? " (default)" : "") +
                            ": difference x 32",
                        std::move(*png)});
  }
  return {};
}

// Slope of log error over log value by least squares; null where fewer than two settings have an
// error.
nlohmann::ordered_json overall_order(const Dial& dial,
                                     const std::vector<Measurement>& measurements) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (size_t s = 0; s < dial.settings.size(); ++s) {
    if (!(measurements[s].error.squared > 0)) continue;
    const double u = std::log(dial.settings[s].value), v = std::log(measurements[s].error.rmse());
    n += 1, x += u, y += v, xx += u * u, xy += u * v;
  }
  const double determinant = n * xx - x * x;
  return n >= 2 && determinant > 0 ? nlohmann::ordered_json((n * xy - x * y) / determinant)
                                   : nlohmann::ordered_json();
}

nlohmann::ordered_json dial_json(const Dial& dial, const std::vector<Measurement>& measurements) {
  nlohmann::ordered_json json = {{"name", dial.name},
                                 {"meaning", dial.meaning},
                                 {"theoretical_order", nullptr},
                                 {"theory", dial.theory}};
  if (dial.theoretical_order) json["theoretical_order"] = *dial.theoretical_order;
  json["observed_order"] = overall_order(dial, measurements);
  json["observed_over"] = "all settings, by least squares";
  json["stages"] = nlohmann::ordered_json::array();
  for (const Stage stage : dial.stages) json["stages"].push_back(to_string(stage));
  json["settings"] = nlohmann::ordered_json::array();
  for (size_t s = 0; s < dial.settings.size(); ++s) {
    const Measurement& m = measurements[s];
    nlohmann::ordered_json row = {{"label", dial.settings[s].label},
                                  {"value", dial.settings[s].value},
                                  {"default", dial.settings[s].is_default}};
    row["psnr_db"] = finite_or_null(m.error.psnr_db());
    row["rmse"] = m.error.rmse();
    row["largest"] = m.error.largest;
    // The slope of log error over log value from the coarser neighbour to this setting.
    row["observed_order"] = nullptr;
    if (s > 0 && m.error.squared > 0 && measurements[s - 1].error.squared > 0) {
      row["observed_order"] = std::log(measurements[s - 1].error.rmse() / m.error.rmse()) /
                              std::log(dial.settings[s - 1].value / dial.settings[s].value);
    }
    const Summary cost_ms = m.log.stages_ms(dial.stages);
    row["cost_ms"] = {{"median", cost_ms.median}, {"p90", cost_ms.p90}};
    row["stages_ms"] = m.log.stages_json();
    row["work"] = m.log.work_json();
    json["settings"].push_back(std::move(row));
  }
  return json;
}

// How unusual the poses of the frames are; null where the package does not say.
nlohmann::ordered_json rarities_json(std::span<const uint32_t> frames, Scene& scene,
                                     const Renderer& renderer) {
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  for (const uint32_t frame : frames) {
    const FrameAvatar seen = scene.pose(frame)[0];
    const Result<std::optional<PoseRarity>> rarity = renderer.pose_rarity(seen.avatar, seen.pose);
    if (!rarity.ok() || !*rarity) return nullptr;
    poses.push_back({{"frame", frame}});
    poses.back().update(rarity_json(**rarity));
  }
  return poses;
}

// Measures a dial whose settings need consecutive frames, over rounds of its sequence.
Status run_sequences(const ReportOptions& options, const RendererOptions& renderer_options,
                     const CameraPathOptions& camera_path, const Dial& dial, uint32_t rounds,
                     std::vector<Measurement>& results) {
  const auto make = [&]() -> Result<SettingRenderer> {
    Result<SceneRenderer> made =
        make_scene_renderer(options.scene, renderer_options, options.device.network_precision());
    if (!made.ok()) return made.status();
    Result<std::vector<uint32_t>> frames = made->scene->frames({});
    if (!frames.ok()) return frames.status();
    Result<std::vector<Camera>> cameras =
        make_camera_path(camera_path, *frames, *made->scene, *made->renderer);
    if (!cameras.ok()) return cameras.status();
    return SettingRenderer(std::move(*made), SceneRenderer{}, std::move(*frames),
                           std::move(*cameras));
  };
  Result<SettingRenderer> reference = make();
  if (!reference.ok()) return reference.status();
  std::vector<SequenceRenderers> settings;
  for (size_t s = 0; s < dial.settings.size(); ++s) {
    Result<SettingRenderer> pictures = make(), timed = make();
    if (!pictures.ok()) return pictures.status();
    if (!timed.ok()) return timed.status();
    settings.push_back({std::move(*pictures), std::move(*timed)});
  }
  return measure_sequences(dial, *reference, settings, rounds * dial.sequence, results);
}

Status run_report(const ReportOptions& options) {
  // Whatever else it is, or is not, is said by what loads an avatar.
  if (const auto loaded = load_package(options.scene.avatars[0]);
      loaded.ok() && (*loaded)->package.kind() == PackageKind::kSampler) {
    const Result<Isa> isa = options.device.instruction_set();
    if (!isa.ok()) return isa.status();
    return run_sampler_report(**loaded, {.body = options.scene.body,
                                         .isa = *isa,
                                         .seeds = options.seeds,
                                         .output = options.output,
                                         .json = options.device.json});
  }
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  CameraPathOptions camera_path;
  if (!options.size.empty()) {
    const Result<ImageSize> size = parse_size(options.size);
    if (!size.ok()) return size.status();
    camera_path.size = *size;
  }
  Result<SceneRenderer> first =
      make_scene_renderer(options.scene, *renderer_options, options.device.network_precision());
  if (!first.ok()) return first.status();
  Scene& scene = *first->scene;
  const bool both = options.device.precision.empty() && scene.holds(Precision::kFloat32) &&
                    scene.holds(Precision::kFixedPoint);
  Result<SceneRenderer> floats =
      both ? make_scene_renderer(options.scene, *renderer_options, Precision::kFloat32)
           : SceneRenderer{};
  if (!floats.ok()) return floats.status();
  uint32_t sh_degree = 0;
  for (size_t i = 0; i < scene.size(); ++i)
    sh_degree = std::max(sh_degree, scene.avatar(i).avatar.decoding.sh_degree);
  // Evenly over the whole motion.
  const Result<std::vector<uint32_t>> all = scene.frames({});
  if (!all.ok()) return all.status();
  std::vector<uint32_t> frames;
  for (uint32_t i = 0; i < std::min<size_t>(options.frames, all->size()); ++i) {
    frames.push_back(
        (*all)[size_t(i) * all->size() / std::min<size_t>(options.frames, all->size())]);
  }
  Result<std::vector<Camera>> cameras =
      make_camera_path(camera_path, frames, scene, *first->renderer);
  if (!cameras.ok()) return cameras.status();
  const std::string precision = scene.precision(*first->renderer);
  const nlohmann::ordered_json rarities = rarities_json(frames, scene, *first->renderer);
  SettingRenderer drawing(std::move(*first), std::move(*floats), std::move(frames),
                          std::move(*cameras));

  const std::vector<Dial> table = dials(both, sh_degree);
  std::vector<std::vector<Measurement>> measurements;
  for (const Dial& dial : table) measurements.emplace_back(dial.settings.size());
  RenderedFrame truth(drawing.size(), PixelFormat::kRgbaF32),
      f32(drawing.size(), PixelFormat::kRgbaF32), u8(drawing.size(), PixelFormat::kRgba8);
  Progress progress("report", options.frames);
  for (uint32_t i = 0; i < options.frames; ++i) {
    for (size_t d = 0; d < table.size(); ++d) {
      if (table[d].sequence > 1) continue;
      FIG_RETURN_IF_ERROR(drawing.draw(i, table[d].reference, truth));
      const size_t count = table[d].settings.size();
      for (size_t turn = 0; turn < count; ++turn) {  // another setting begins each round: nobody is
                                                     // always first after the reference
        FIG_RETURN_IF_ERROR(check_interrupt());
        const size_t s = (i + turn) % count;
        FIG_RETURN_IF_ERROR(
            drawing.measure(i, table[d].settings[s], truth, u8, f32, measurements[d][s]));
      }
    }
    progress.update(i + 1);
  }
  for (size_t d = 0; d < table.size(); ++d) {
    if (table[d].sequence == 1) continue;
    const uint32_t rounds = (options.frames + table[d].sequence - 1) / table[d].sequence;
    FIG_RETURN_IF_ERROR(
        run_sequences(options, *renderer_options, camera_path, table[d], rounds, measurements[d]));
  }

  nlohmann::ordered_json json = json_header("report");
  json["date"] = ports::date_utc();
  json["machine"] = json_machine(options.device, renderer_options->threads, precision);
  json["avatar"] = options.scene.avatars[0];
  json["motion"] = options.scene.motions.empty() ? nlohmann::ordered_json()
                                                 : nlohmann::ordered_json(options.scene.motions[0]);
  json["frames"] = options.frames;
  json["poses"] = rarities;
  json["size"] = {drawing.size().width_px, drawing.size().height_px};
  json["reference"] = {{"alpha_cut", kReferenceCut}, {"meaning", kReferenceMeaning}};
  json["metric"] =
      "PSNR over pixels whose alpha in the reference exceeds 0.5, on stored sRGB values in float "
      "over mid-grey, squared errors pooled over "
      "all "
      "frames; largest is the largest difference of one value there";
  json["timing"] =
      "median over the frames, settings taking turns within each frame; every frame has a fresh "
      "pose and a run of the network, but for the dial of the network's interval: there medians "
      "are over means of eight frames in a row";
  json["dials"] = nlohmann::ordered_json::array();
  for (size_t d = 0; d < table.size(); ++d)
    json["dials"].push_back(dial_json(table[d], measurements[d]));
  std::vector<ReportPicture> pictures;
  FIG_RETURN_IF_ERROR(draw_pictures(drawing, options.frames / 2, table[0], pictures));
  FIG_RETURN_IF_ERROR(write_report(options.output, json, report_html(json, pictures)));
  return write_json(options.device.json, json);
}

}  // namespace

Command add_report_command(CLI::App& app) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App* command =
      app.add_subcommand("report", "Plots error against run time: report.json and report.html");
  options->scene.avatars.resize(1);
  command
      ->add_option("avatar", options->scene.avatars[0],
                   "avatar or sampler package (.fgn), or a member of a population "
                   "(people.fgn#NAME, people.fgn#17)")
      ->required();
  add_body_option(*command, options->scene.body);
  add_motion_option(*command, options->scene.motions, "the golden pose, swaying");
  command->add_option("--frames", options->frames, "measured frames, evenly over the motion")
      ->check(ports::between(1, 10000))
      ->capture_default_str();
  command->add_option("--seeds", options->seeds, "of a sampler: people whose errors are pooled")
      ->check(ports::between(1, 1000))
      ->capture_default_str();
  add_size_option(*command, options->size, "the golden frame's");
  command->add_option("-o,--output", options->output, "folder for report.json and report.html")
      ->required();
  options->device.add_to(*command);
  return {command, [options] { return run_report(*options); }};
}

}  // namespace figurine::samples
