// figurine-train: the offline commands. Only this folder catches exceptions: exit 1 bad input or a
// lost standard output, 2 usage, 3 bug, 130 interrupted (state saved).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"

namespace {

int run(int argc, char** argv) {
  CLI::App app{"figurine-train: bodies, captures, avatars and packages, offline"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "figurine-train " FIGURINE_VERSION);
  figurine::cli::add_force_threads(app, argc, argv);
  figurine::cli::add_body_command(app);
  figurine::cli::add_motion_command(app);
  figurine::cli::add_capture_command(app);
  figurine::cli::add_check_capture_command(app);
  figurine::cli::add_avatar_command(app);
  figurine::cli::add_basis_command(app);
  figurine::cli::add_pack_command(app);
  figurine::cli::add_population_command(app);
  figurine::cli::add_sampler_command(app);
  figurine::cli::add_features_command(app);
  figurine::cli::add_evaluate_command(app);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const figurine::InputError& error) {
    std::fprintf(stderr, "figurine-train: %s\n", error.what());
    return 1;
  } catch (const figurine::train::Interrupted& interrupted) {
    std::fprintf(stderr, "figurine-train: %s\n", interrupted.what());
    return 130;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "figurine-train: internal error: %s\n", error.what());
    return 3;
  }
}

}  // namespace

int main(int argc, char** argv) {
  figurine::ports::prepare_process("figurine-train");
  const int code = run(argc, argv);
  const figurine::Status printed = figurine::ports::flush_standard_output();
  if (code != 0 || printed.ok()) return code;
  std::fprintf(stderr, "figurine-train: %s\n", printed.message().c_str());
  return 1;
}
