// figurine-train motion: a captured clip, moved onto a body's skeleton, becomes a motion package.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "toolchain/body/clip.h"
#include "toolchain/body/gaze.h"
#include "toolchain/body/motion_loop.h"
#include "toolchain/body/retarget.h"
#include "toolchain/cli/commands.h"
#include "toolchain/error.h"

namespace figurine::cli {
namespace {

struct MotionOptions {
  std::string clip;
  std::string body;
  std::string output;
  body::RetargetOptions retarget;
  std::string source;
  uint32_t start = 0;
  uint32_t frames = 0;
  std::string neutral;
  std::string up = "z";
  uint32_t loop_cycles = 0;
  bool in_place = false;
  float head_pitch_deg = 0;
};

constexpr float kDegrees = 57.29578f;

void run_motion(MotionOptions options, bool has_start, bool has_frames, bool has_head_pitch) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(options.body), "--body");
  const Package package = value_or_throw(Package::open(file.bytes(), options.body), "--body");
  if (package.kind() != PackageKind::kBody)
    throw InputError(options.body + ": a " + to_string(package.kind()) + " package, not a body");

  const std::filesystem::path path(options.clip);
  const std::string extension = path.extension().string();
  body::RetargetOptions& retarget = options.retarget;
  if (retarget.name.empty()) retarget.name = path.stem().string();
  if (has_start) retarget.start = options.start;
  if (has_frames) retarget.frames = options.frames;
  if (options.neutral == "first") retarget.neutral = body::Neutral::kFirstFrame;
  if (options.neutral == "zero") retarget.neutral = body::Neutral::kZeroPose;
  if (options.neutral == "axes") retarget.neutral = body::Neutral::kBoneAxes;
  retarget.z_up = options.up == "z";

  body::RetargetReport report;
  if (extension == ".fgn") throw InputError(options.clip + ": is a motion package already");
  body::MotionClip clip = body::read_clip(options.clip, package.body(), retarget, &report);

  if (options.loop_cycles > 0) {
    body::LoopReport loop;
    clip =
        body::make_loop(clip, {.cycles = options.loop_cycles, .in_place = options.in_place}, &loop);
    std::printf("cycle of %u frames from frame %u of the result, gap %.1f degrees\n", loop.length,
                loop.first_frame, double{kDegrees * loop.gap_rad});
  }

  if (has_head_pitch) clip = body::with_head_pitch(clip, options.head_pitch_deg / kDegrees);
  const body::HeadPitch pitch = body::measure_head_pitch(clip);

  Provenance provenance;
  provenance.tool = "figurine-train " FIGURINE_VERSION;
  provenance.settings = {
      {"command", "motion " + path.filename().string()},
      {"body", format_hash(package.content_hash())},
      {"start", has_start ? std::to_string(options.start) : "first of the motion"},
      {"frames", std::to_string(clip.frame_count)},
      {"loop_cycles", std::to_string(options.loop_cycles)},
      {"smooth_s", std::to_string(retarget.smooth_s.value_or(
                       extension == ".glb" ? 0 : body::kCaptureSmoothS))}};
  if (has_head_pitch)
    provenance.settings.push_back({"head_pitch_deg", std::to_string(options.head_pitch_deg)});
  if (extension == ".glb")
    provenance.settings.push_back({"animation", std::to_string(retarget.animation)});
  provenance.sources = {options.source.empty() ? body::clip_source(options.clip) : options.source};
  const auto bytes = value_or_throw(write_package(clip.view(), provenance), options.output);
  throw_if_error(ports::write_file_atomically(options.output, bytes), "-o");
  std::printf(
      "%s: %u frames at %g a second, soles in contact %.1f mm from the ground on average (lowest "
      "%.1f), largest step of a joint %.1f "
      "degrees, head pitched by %.0f degrees (%.0f to %.0f), %zu "
      "bytes\n",
      options.output.c_str(), clip.frame_count, double{clip.frames_per_second},
      1e3 * double{report.mean_contact_m}, 1e3 * double{report.lowest_sole_m},
      double{kDegrees * report.largest_step_rad}, double{kDegrees * pitch.mean_rad},
      double{kDegrees * pitch.lowest_rad}, double{kDegrees * pitch.highest_rad}, bytes.size());
}

}  // namespace

void add_motion_command(CLI::App& app) {
  auto options = std::make_shared<MotionOptions>();
  CLI::App* command =
      app.add_subcommand("motion", "Move a captured clip (.bvh, .npz, .glb) onto a body");
  command
      ->add_option("clip", options->clip,
                   "CLIP.bvh with CMU's joint names, an AMASS-style CLIP.npz, or a glTF CLIP.glb "
                   "with HumanIK's joint names")
      ->required();
  command->add_option("--body", options->body, "BODY.fgn")->required();
  command->add_option("-o,--output", options->output, "MOTION.fgn")->required();
  command->add_option("--fps", options->retarget.frames_per_second, "Frames a second of the result")
      ->check(CLI::Range(1.0, 240.0));
  const CLI::Option* start =
      command->add_option("--start", options->start,
                          "First frame of the clip, counted as in the file (GLB: at --fps); "
                          "default: after the neutral frame");
  const CLI::Option* frames =
      command->add_option("--frames", options->frames, "Frames of the result; default: to the end")
          ->check(CLI::PositiveNumber);
  command->add_option("--name", options->retarget.name, "Name of the motion; default: the file's");
  command
      ->add_option("--smooth", options->retarget.smooth_s,
                   "Standard deviation of the smoothing over time, seconds; default: 0.03, GLB: 0")
      ->check(CLI::Range(0.0, 0.5));
  command
      ->add_option("--neutral", options->neutral,
                   "The T-pose is the first frame (default of BVH), the zero pose, or told by the "
                   "bones' axes (default of GLB)")
      ->check(CLI::IsMember({"first", "zero", "axes"}));
  command->add_option("--animation", options->retarget.animation,
                      "GLB: which of the file's animations, counted from 0");
  command->add_option("--up", options->up, "NPZ: the world's up axis")
      ->check(CLI::IsMember({"z", "y"}));
  CLI::Option* loop = command
                          ->add_option("--loop", options->loop_cycles,
                                       "Repeat the best gait cycle this often, straight ahead")
                          ->check(CLI::Range(1u, 1000u));
  command->add_flag("--in-place", options->in_place, "With --loop: walk on the spot")->needs(loop);
  const CLI::Option* head_pitch =
      command
          ->add_option(
              "--head-pitch", options->head_pitch_deg,
              "Turn neck and head, by one angle for the whole clip, until the face looks up "
              "by this many degrees on average; 0: ahead; default: as captured")
          ->check(CLI::Range(-80.0f, 80.0f));
  command->add_option("--source", options->source,
                      "Provenance line: where the clip is from and under which terms");
  command->callback([options, start, frames, head_pitch] {
    run_motion(*options, start->count() > 0, frames->count() > 0, head_pitch->count() > 0);
  });
}

}  // namespace figurine::cli
