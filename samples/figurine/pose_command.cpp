// figurine pose: a frame of a motion as a pose file, to look at, to edit, and for --pose.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/command_line.h"
#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "samples/common/device_options.h"
#include "samples/common/loading.h"
#include "samples/common/pose_json.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

struct PoseOptions {
  std::string from, output, json;
  uint32_t frame = 0;
};

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
  ports::add_json_option(*command, options->json)->needs(output);
  return {command, [options] { return run_pose(*options); }};
}

}  // namespace figurine::samples
