// figurine-train known-poses: into an avatar package that is trained already, what poses it was
// trained on, from its capture or from that capture's motions.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "ports/motion/clip.h"
#include "toolchain/capture/sequence.h"
#include "toolchain/cli/commands.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/error.h"
#include "toolchain/train/known_poses.h"
#include "toolchain/train/package_file.h"

namespace figurine::cli {
namespace {

struct KnownPosesOptions {
  std::string avatar, body, data, output;
  std::vector<std::string> motions;
  uint32_t frames = 0;  // 0: every frame of the motions is a training pose
};

using Poses = std::vector<std::vector<float>>;  // [F] of [J,4]

// Those that training saw: neither the held-out ones nor the block.
Poses poses_of_capture(const KnownPosesOptions& options, const Package& body) {
  const dataset::Dataset data =
      dataset::Dataset::open(options.data, {.body = &body.body(),
                                            .body_hash = format_hash(body.content_hash()),
                                            .origin = dataset::model_origin(body, options.body)});
  Poses poses;
  for (const dataset::CaptureFrame& frame : data.frames()) {
    if (frame.split == dataset::FrameSplit::kTrain) poses.push_back(frame.rotations);
  }
  return poses;
}

Poses poses_of_motions(const KnownPosesOptions& options, const Body& body) {
  std::vector<ports::MotionClip> clips;
  for (const std::string& path : options.motions)
    clips.push_back(value_or_throw(ports::read_clip(path, body, {.name = path}, nullptr)));
  Poses poses;
  if (options.frames > 0) {
    for (const capture::CapturedPose& captured :
         capture::make_sequence(clips, {.frames = options.frames})) {
      if (captured.split == dataset::FrameSplit::kTrain) poses.push_back(captured.pose.rotations);
    }
    return poses;
  }
  for (const ports::MotionClip& clip : clips) {
    for (uint32_t frame = 0; frame < clip.frame_count; ++frame)
      poses.push_back(clip.pose(frame).rotations);
  }
  return poses;
}

void run_known_poses(const KnownPosesOptions& options) {
  const train::PackageFile avatar = train::open_package(options.avatar, PackageKind::kAvatar),
                           body = train::open_package(options.body, PackageKind::kBody);
  throw_if_error(check_avatar_fits_body(avatar.package.avatar(), body.package), options.avatar);
  const Poses poses = options.data.empty() ? poses_of_motions(options, body.package.body())
                                           : poses_of_capture(options, body.package);
  const train::KnownPoseStatistics known =
      train::known_poses(poses, body.package.body().joint_count());
  const std::vector<std::byte> bytes = train::with_known_poses(avatar.package, known);
  throw_if_error(ports::write_file_atomically(options.output, bytes), "cannot save");
  ports::sayf(
      "%s: %zu bytes, knows %zu poses at distances of %.1f to %.1f, half of them within %.1f",
      options.output.c_str(), bytes.size(), poses.size(),
      static_cast<double>(known.distances.front()), static_cast<double>(known.distances.back()),
      static_cast<double>(known.distances[known.distances.size() / 2]));
}

}  // namespace

void add_known_poses_command(CLI::App& app) {
  auto options = std::make_shared<KnownPosesOptions>();
  CLI::App* command = app.add_subcommand(
      "known-poses", "Write into a trained avatar's package which poses it was trained on");
  command->add_option("avatar", options->avatar, "Avatar package (.fgn)")->required();
  command->add_option("--body", options->body, "BODY.fgn that it was made for")->required();
  CLI::Option* data =
      command->add_option("--data", options->data, "Folder of the identity that it was trained on");
  CLI::Option* motions =
      command->add_option("--motion", options->motions,
                          "In place of that, the motions of its capture in their order: clips or "
                          "MOTION.fgn, one or more");
  motions->excludes(data);
  command
      ->add_option("--frames", options->frames,
                   "Poses of that capture, as capture --frames chose them, held-out ones left "
                   "out; default: every frame of the motions")
      ->check(ports::between(1, 10'000))
      ->needs(motions);
  command->add_option("-o,--output", options->output, "Package to write")->required();
  command->callback([options, data, motions] {
    if (data->count() == 0 && motions->count() == 0)
      throw CLI::ValidationError("known-poses", "give --data or --motion");
    run_known_poses(*options);
  });
}

}  // namespace figurine::cli
