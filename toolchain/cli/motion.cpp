// figurine-train motion: a captured clip, moved onto a body's skeleton, becomes a motion package.
// The same as figurine motion of the device's half (ports/motion/import.h).
#include <CLI/CLI.hpp>
#include <memory>

#include "formats/writer/package_writer.h"
#include "ports/command_line/command_line.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
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
  ports::say(options.output + ": " + motion.summary + "; " + std::to_string(bytes.size()) +
             " bytes");
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
  ports::add_text_options(*command, ports::import_options(options->import));
  command->callback([options] { run_motion(*options); });
}

}  // namespace figurine::cli
