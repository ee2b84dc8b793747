// One function per command of figurine: adds the subcommand and its options, and says how to run
// it.
#pragma once

#include <functional>
#include <vector>

#include "figurine/status.h"

namespace CLI {
class App;
}

namespace figurine::samples {

struct Command {
  CLI::App* app = nullptr;
  std::function<Status()> run;
};

Command add_sample_command(CLI::App& app);
Command add_render_command(CLI::App& app);
Command add_live_command(CLI::App& app);
Command add_splat_command(CLI::App& app);
Command add_export_command(CLI::App& app);
Command add_motion_command(CLI::App& app);
Command add_pose_command(CLI::App& app);
Command add_bench_command(CLI::App& app);
Command add_report_command(CLI::App& app);
Command add_selftest_command(CLI::App& app);

// All of them, and what the program itself has.
std::vector<Command> add_commands(CLI::App& app);

}  // namespace figurine::samples
