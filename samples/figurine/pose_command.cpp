// figurine pose: a frame of a motion as a pose file, to look at, to edit, and for --pose.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/command_line/command_line.h"
#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/device_options.h"
#include "samples/common/loading.h"
#include "samples/common/pose_json.h"
#include "samples/common/pose_rarity.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

struct PoseOptions {
  std::string from, output, avatar, body, json;
  uint32_t frame = 0;
};

// How unusual the frame is to the avatar.
Result<PoseRarity> rarity_of(const PoseOptions& options, const Motion& motion) {
  const Result<std::unique_ptr<LoadedAvatar>> avatar = load_avatar(options.avatar);
  if (!avatar.ok()) return avatar.status();
  const Result<std::unique_ptr<LoadedPackage>> body = find_body(**avatar, options.body);
  if (!body.ok()) return body.status();
  FIG_RETURN_IF_ERROR(check_motion_fits_body(motion, (*body)->package.body()));
  const PoseStatistics& statistics = (*avatar)->avatar.pose_statistics;
  if (statistics.distances.empty()) {
    return Status(StatusCode::kUnsupported,
                  options.avatar +
                      ": does not say which poses it knows (figurine-train "
                      "known-poses)");
  }
  const Result<KnownPoses> known = KnownPoses::create(statistics);
  if (!known.ok()) return known.status().within(options.avatar);
  return known->rarity(motion.pose(options.frame).rotations);
}

Status run_pose(const PoseOptions& options) {
  const Result<std::unique_ptr<LoadedPackage>> loaded =
      load_package(options.from, PackageKind::kMotion);
  if (!loaded.ok()) return loaded.status();
  const Motion& motion = (*loaded)->package.motion();
  if (options.frame >= motion.frame_count) {
    return Status(StatusCode::kInvalidArgument,
                  options.from + ": frame " + std::to_string(options.frame) + ": the motion has " +
                      std::to_string(motion.frame_count) + " frames, counted from 0");
  }
  std::optional<PoseRarity> rarity;
  if (!options.avatar.empty()) {
    const Result<PoseRarity> found = rarity_of(options, motion);
    if (!found.ok()) return found.status();
    rarity = *found;
    ports::sayf("%s: frame %u: %s", options.from.c_str(), options.frame, describe(*rarity).c_str());
  }
  const std::string text = write_pose_json(motion.pose(options.frame), motion.joint_names);
  if (options.output.empty()) {
    std::fputs(text.c_str(), stdout);
    return {};
  }
  FIG_RETURN_IF_ERROR(ports::write_file_atomically(options.output, std::as_bytes(std::span(text))));
  nlohmann::ordered_json json = json_header("pose");
  json["motion"] = options.from;
  json["frame"] = options.frame;
  json["output"] = options.output;
  json["joints"] = motion.joint_names.size();
  json["size_bytes"] = text.size();
  if (rarity) json["rarity"] = rarity_json(*rarity);
  return write_json(options.json, json);
}

}  // namespace

Command add_pose_command(CLI::App& app) {
  auto options = std::make_shared<PoseOptions>();
  CLI::App* command =
      app.add_subcommand("pose", "Writes a frame of a motion as a pose file (.json)");
  command->add_option("--from", options->from, "motion package (.fgn)")->required();
  command->add_option("--frame", options->frame, "of the motion, counted from 0")
      ->check(ports::between(0, UINT32_MAX - 1))
      ->capture_default_str();
  CLI::Option* output =
      command->add_option("-o,--output", options->output, "x.json; default: standard output");
  command->add_option("--avatar", options->avatar,
                      "avatar package (.fgn): say how unusual the pose is to it");
  add_body_option(*command, options->body);
  ports::add_json_option(*command, options->json)->needs(output);
  return {command, [options] { return run_pose(*options); }};
}

}  // namespace figurine::samples
