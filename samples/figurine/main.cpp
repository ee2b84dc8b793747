// figurine: avatars and Gaussians on this device.
//
// Exit codes: 0 done, 1 bad input (one line naming file, field and reason; no output file) or a
// lost standard output, 2 usage, 3 a bug of figurine. An interrupt ends the process the way the
// signal would have.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "ports/host/process.h"
#include "samples/common/progress.h"
#include "samples/figurine/commands.h"

namespace {

int run(int argc, char** argv) {
  using namespace figurine;
  CLI::App app{"figurine: samples and renders pose-driven Gaussian avatars on a CPU"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "figurine " FIGURINE_VERSION);
  try {
    const samples::Command commands[] = {
        samples::add_sample_command(app), samples::add_render_command(app),
        samples::add_splat_command(app),  samples::add_export_command(app),
        samples::add_motion_command(app), samples::add_pose_command(app),
        samples::add_live_command(app),   samples::add_bench_command(app),
        samples::add_report_command(app), samples::add_selftest_command(app)};
    app.parse(argc, argv);
    samples::catch_interrupts();
    for (const samples::Command& command : commands) {
      if (!command.app->parsed()) continue;
      const Status status = command.run();
      if (status.ok()) return 0;
      std::fprintf(stderr, "figurine: %s\n", status.message().c_str());
      if (status.code() == StatusCode::kInterrupted) samples::die_of_interrupt();
      return 1;
    }
    return 2;
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "figurine: %s (figurine --help)\n", error.what());
    return 2;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "figurine: out of memory\n");
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "figurine: internal error: %s\n", error.what());
    return 3;
  }
}

}  // namespace

int main(int argc, char** argv) {
  figurine::ports::prepare_process("figurine");
  const int code = run(argc, argv);
  const figurine::Status printed = figurine::ports::flush_standard_output();
  if (code != 0 || printed.ok()) return code;
  std::fprintf(stderr, "figurine: %s\n", printed.message().c_str());
  return 1;
}
