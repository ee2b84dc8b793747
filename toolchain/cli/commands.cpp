#include "toolchain/cli/commands.h"

#include <CLI/CLI.hpp>

#include "ports/command_line/command_line.h"
#include "toolchain/cli/threads.h"

namespace figurine::cli {

void add_commands(CLI::App& app, int argc, const char* const* argv) {
  app.require_subcommand(1);
  app.set_version_flag("--version", "figurine-train " FIGURINE_VERSION);
  ports::prepare_help(app);
  add_force_threads(app, argc, argv);
  add_body_command(app);
  add_motion_command(app);
  add_capture_command(app);
  add_check_capture_command(app);
  add_avatar_command(app);
  add_basis_command(app);
  add_pack_command(app);
  add_known_poses_command(app);
  add_population_command(app);
  add_sampler_command(app);
  add_features_command(app);
  add_evaluate_command(app);
}

}  // namespace figurine::cli
