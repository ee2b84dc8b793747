// figurine motion: a captured clip, moved onto a body's skeleton, becomes a motion package. The
// same as figurine-train motion (ports/motion/import.h), without the toolchain.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "ports/motion/import.h"
#include "samples/common/device_options.h"
#include "samples/common/loading.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

struct MotionOptions {
  ports::ImportSettings import;
  std::string body, output;
  bool json = false;
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
  std::fprintf(stderr, "figurine: %s: %s; %zu bytes\n", options.output.c_str(),
               motion->summary.c_str(), bytes->size());
  if (options.json) {
    nlohmann::ordered_json json = json_header("motion");
    json["clip"] = options.import.clip;
    json["output"] = options.output;
    json["frames"] = motion->clip.frame_count;
    json["frames_per_second"] = motion->clip.frames_per_second;
    json["source"] = motion->provenance.sources[0];
    json["summary"] = motion->summary;
    json["size_bytes"] = bytes->size();
    print_json(json);
  }
  return {};
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
  for (const ports::ImportOption& option : ports::import_options(options->import)) {
    const auto set = [option](const std::string& text) {
      const Status status = option.set(text);
      if (!status.ok()) throw CLI::ValidationError(option.name, status.message());
    };
    if (option.is_flag) {
      command->add_flag_callback(option.name, [set] { set(""); }, option.help);
    } else {
      command->add_option_function<std::string>(option.name, set, option.help);
    }
  }
  command->add_flag("--json", options->json, "print a summary as JSON to standard output");
  return {command, [options] { return run_motion(*options); }};
}

}  // namespace figurine::samples
