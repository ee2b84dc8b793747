// figurine-emulator: what a device would show, at a desk (docs/emulator.md).
//
// Ends as all programs do (docs/command_line.md). A file that is wrong is a line in the window, and
// no end.
#include <CLI/CLI.hpp>
#include <fstream>
#include <sstream>

#include "ports/command_line/command_line.h"
#include "ports/command_line/values.h"
#include "ports/host/process.h"
#include "samples/common/device_options.h"
#include "samples/common/parse.h"
#include "samples/common/progress.h"
#include "samples/emulator/app.h"

namespace figurine::emulator {

namespace {

struct EmulatorOptions {
  std::vector<std::string> files;
  std::string script, size = "1280x800", profile = "desk", background = "#dbe0e6";
  float letters_px = 15;
  samples::DeviceOptions device;
};

Result<std::optional<Script>> read_script(const std::string& path) {
  if (path.empty()) return std::optional<Script>();
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) return Status(StatusCode::kIo, path + ": cannot be read");
  Result<std::vector<ScriptCommand>> commands = parse_script(text.str(), path);
  if (!commands.ok()) return commands.status();
  return std::optional(Script(std::move(*commands), path));
}

Status run(const EmulatorOptions& options) {
  const Result<samples::ImageSize> size = samples::parse_size(options.size);
  if (!size.ok()) return size.status();
  const Result<samples::Background> background = samples::parse_background(options.background);
  if (!background.ok()) return background.status();
  const DeviceProfile* const profile = find_profile(options.profile);
  if (profile == nullptr)
    return Status(StatusCode::kInvalidArgument, "profile '" + options.profile + "': there is none");
  Result<std::optional<Script>> script = read_script(options.script);
  if (!script.ok()) return script.status();
  const Result<RendererOptions> renderer = options.device.renderer_options();
  if (!renderer.ok()) return renderer.status();
  Session::Options session_options{.threads = renderer->threads,
                                   .isa = renderer->isa,
                                   .precision = options.device.network_precision()};
  if (background->colour) session_options.background = *background->colour;
  const Result<std::unique_ptr<Session>> session = Session::create(session_options);
  if (!session.ok()) return session.status();
  FIG_RETURN_IF_ERROR((*session)->set_profile(*profile));
  const Result<std::unique_ptr<App>> app = App::open(
      {.width_px = size->width_px, .height_px = size->height_px, .letters_px = options.letters_px});
  if (!app.ok()) return app.status();
  for (const std::string& file : options.files) (*session)->open(file);
  return (*app)->run(**session, std::move(*script));
}

int run(int argc, char** argv) {
  CLI::App app{"figurine-emulator: what a device would show, at a desk", "figurine-emulator"};
  app.set_version_flag("--version", "figurine-emulator " FIGURINE_VERSION);
  ports::prepare_help(app);
  EmulatorOptions options;
  app.add_option("files", options.files,
                 "avatars, a motion, a sampler (.fgn), a file of Gaussians (.ply, .splat, .spz)");
  app.add_option("--script", options.script, "commands to carry out (docs/emulator.md)");
  std::vector<std::string> profiles;
  for (const DeviceProfile& each : device_profiles()) profiles.push_back(each.name);
  app.add_option("--profile", options.profile, "which device")
      ->check(ports::one_of(profiles))
      ->capture_default_str();
  app.add_option("--size", options.size, "WIDTHxHEIGHT of the window")->capture_default_str();
  samples::add_background_option(app, options.background, true, options.background);
  app.add_option("--letters", options.letters_px, "height of the window's text in pixels")
      ->check(ports::between(8.0, 64.0))
      ->capture_default_str();
  options.device.add_to(app, {.json = true});
  if (const std::optional<int> code = ports::parse_command_line(app, argc, argv)) return *code;
  samples::catch_interrupts();
  const Status status = run(options);
  if (status.ok()) return ports::kDone;
  ports::say(status.message());
  if (status.code() == StatusCode::kInterrupted) samples::die_of_interrupt();
  return ports::kBadInput;
}

}  // namespace

}  // namespace figurine::emulator

int main(int argc, char** argv) {
  return figurine::ports::run_program("figurine-emulator",
                                      [&] { return figurine::emulator::run(argc, argv); });
}
