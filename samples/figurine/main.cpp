// figurine: avatars and Gaussians on this device. How it ends: docs/command_line.md; an interrupt
// ends it the way the signal would have.
#include <CLI/CLI.hpp>

#include "ports/command_line/command_line.h"
#include "ports/host/process.h"
#include "samples/common/progress.h"
#include "samples/figurine/commands.h"

namespace {

int run(int argc, char** argv) {
  using namespace figurine;
  CLI::App app{"figurine: samples and renders pose-driven Gaussian avatars on a CPU", "figurine"};
  const std::vector<samples::Command> commands = samples::add_commands(app);
  if (const std::optional<int> code = ports::parse_command_line(app, argc, argv)) return *code;
  samples::catch_interrupts();
  for (const samples::Command& command : commands) {
    if (!command.app->parsed()) continue;
    const Status status = command.run();
    if (status.ok()) return ports::kDone;
    ports::say(status.message());
    if (status.code() == StatusCode::kInterrupted) samples::die_of_interrupt();
    return ports::kBadInput;
  }
  return ports::kUsage;
}

}  // namespace

int main(int argc, char** argv) {
  return figurine::ports::run_program("figurine", [&] { return run(argc, argv); });
}
