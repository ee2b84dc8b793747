#include "samples/figurine/commands.h"

#include <CLI/CLI.hpp>

#include "ports/command_line/command_line.h"

namespace figurine::samples {

std::vector<Command> add_commands(CLI::App& app) {
  app.require_subcommand(1);
  app.set_version_flag("--version", "figurine " FIGURINE_VERSION);
  ports::prepare_help(app);
  return {add_sample_command(app),  add_render_command(app), add_splat_command(app),
          add_export_command(app),  add_motion_command(app), add_pose_command(app),
          add_live_command(app),    add_bench_command(app),  add_report_command(app),
          add_selftest_command(app)};
}

}  // namespace figurine::samples
