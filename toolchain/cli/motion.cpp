// figurine-train motion: a captured clip, moved onto a body's skeleton, becomes a motion package.
// The same as figurine motion of the device's half (ports/motion/import.h).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "ports/motion/import.h"
#include "toolchain/cli/commands.h"
#include "toolchain/error.h"

namespace figurine::cli {
namespace {

struct MotionOptions {
  ports::ImportSettings import;
  std::string body;
  std::string output;
};

void run_motion(const MotionOptions& options) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(options.body), "--body");
  const Package package = value_or_throw(Package::open(file.bytes(), options.body), "--body");
  if (package.kind() != PackageKind::kBody)
    throw InputError(options.body + ": a " + to_string(package.kind()) + " package, not a body");
  ports::ImportedMotion motion =
      value_or_throw(ports::import_motion(options.import, package.body(), package.content_hash()));
  motion.provenance.tool = "figurine-train " FIGURINE_VERSION;
  const auto bytes =
      value_or_throw(write_package(motion.clip.view(), motion.provenance), options.output);
  throw_if_error(ports::write_file_atomically(options.output, bytes), "-o");
  std::printf("%s: %s; %zu bytes\n", options.output.c_str(), motion.summary.c_str(), bytes.size());
}

}  // namespace

void add_motion_command(CLI::App& app) {
  auto options = std::make_shared<MotionOptions>();
  CLI::App* command = app.add_subcommand(
      "motion", "Move a captured clip (.bvh, .npz, .glb, .gltf, .vrma) onto a body");
  command
      ->add_option("clip", options->import.clip,
                   "A BVH, SMPL's parameters in an .npz (AMASS), or a glTF animation")
      ->required();
  command->add_option("--body", options->body, "BODY.fgn")->required();
  command->add_option("-o,--output", options->output, "MOTION.fgn")->required();
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
  command->callback([options] { run_motion(*options); });
}

}  // namespace figurine::cli
