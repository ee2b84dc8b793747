// figurine-train: the offline commands. Only this folder catches exceptions. How it ends:
// docs/command_line.md; 130 when interrupted, with its state saved.
#include <CLI/CLI.hpp>

#include "ports/command_line/command_line.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"

namespace {

int run(int argc, char** argv) {
  using namespace figurine;
  CLI::App app{"figurine-train: bodies, captures, avatars and packages, offline", "figurine-train"};
  cli::add_commands(app, argc, argv);
  try {
    return ports::parse_command_line(app, argc, argv).value_or(ports::kDone);
  } catch (const InputError& error) {
    ports::say(error.what());
    return ports::kBadInput;
  } catch (const train::Interrupted& interrupted) {
    ports::say(interrupted.what());
    return 130;
  }
}

}  // namespace

int main(int argc, char** argv) {
  return figurine::ports::run_program("figurine-train", [&] { return run(argc, argv); });
}
