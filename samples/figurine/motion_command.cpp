// figurine motion: a captured clip, moved onto a body's skeleton, becomes a motion package. The
// same as figurine-train motion (ports/motion/import.h), without the toolchain.
#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/writer/package_writer.h"
#include "ports/command_line/command_line.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "ports/motion/import.h"
#include "samples/common/device_options.h"
#include "samples/common/loading.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

struct MotionOptions {
  ports::ImportSettings import;
  std::string body, output, json;
};

Status run_motion(const MotionOptions& options) {
  const Result<std::unique_ptr<LoadedPackage>> body =
      load_package(options.body, PackageKind::kBody);
  if (!body.ok()) return body.status();
  const Package& package = (*body)->package;
  Result<ports::ImportedMotion> motion =
      ports::import_motion(options.import, package.body(), package.content_hash());
  if (!motion.ok()) return motion.status();
  motion->provenance.tool = "figurine " FIGURINE_VERSION;
  const Result<std::vector<std::byte>> bytes =
      write_package(motion->clip.view(), motion->provenance);
  if (!bytes.ok()) return bytes.status().within(options.output);
  FIG_RETURN_IF_ERROR(ports::write_file_atomically(options.output, *bytes));
  ports::say(options.output + ": " + motion->summary + "; " + std::to_string(bytes->size()) +
             " bytes");
  nlohmann::ordered_json json = json_header("motion");
  json["clip"] = options.import.clip;
  json["output"] = options.output;
  json["frames"] = motion->clip.frame_count;
  json["frames_per_second"] = motion->clip.frames_per_second;
  json["source"] = motion->provenance.sources[0];
  json["summary"] = motion->summary;
  json["size_bytes"] = bytes->size();
  return write_json(options.json, json);
}

}  // namespace

Command add_motion_command(CLI::App& app) {
  auto options = std::make_shared<MotionOptions>();
  CLI::App* command = app.add_subcommand(
      "motion", "Moves a captured clip (.bvh, .npz, .glb, .gltf, .vrma) onto a body");
  command
      ->add_option("clip", options->import.clip,
                   "a BVH, SMPL's parameters in an .npz (AMASS), or a glTF animation")
      ->required();
  command->add_option("--body", options->body, "body package (.fgn)")->required();
  command->add_option("-o,--output", options->output, "motion package (.fgn)")->required();
  ports::add_text_options(*command, ports::import_options(options->import));
  ports::add_json_option(*command, options->json);
  return {command, [options] { return run_motion(*options); }};
}

}  // namespace figurine::samples
