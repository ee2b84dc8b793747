// figurine-train check-capture: the posed body over every view, and what does not fit.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/dataset/capture_check.h"
#include "toolchain/dataset/picture_file.h"
#include "toolchain/error.h"

namespace figurine::cli {

namespace {

struct CheckArguments {
  std::string data, body, output;
  uint32_t frames = 8;
  bool no_pictures = false;
};

void make_folders(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path + ": " + error.message());
}

void run(CheckArguments arguments) {
  while (arguments.data.size() > 1 && arguments.data.ends_with('/')) arguments.data.pop_back();
  if (arguments.output.empty()) arguments.output = arguments.data + "_check";
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(arguments.body), "--body");
  const Package package =
      value_or_throw(Package::open(file.bytes(), arguments.body), arguments.body);
  if (package.kind() != PackageKind::kBody)
    throw InputError(arguments.body + ": a " + to_string(package.kind()) + " package, not a body");
  dataset::Dataset data = dataset::Dataset::open(
      arguments.data, {.body = &package.body(),
                       .body_hash = format_hash(package.content_hash()),
                       .origin = dataset::model_origin(package, arguments.body)});
  data.leave_out_blank_cameras();
  ports::sayf("%s: %zu cameras, %zu frames", arguments.data.c_str(), data.cameras().size(),
              data.frames().size());
  for (const std::string& remark : data.remarks()) ports::say(remark);

  const auto draw = [&](const dataset::ViewCheck& view, const ports::ImageU8& picture) {
    const std::string folder = arguments.output + "/" + data.cameras()[view.camera].name;
    make_folders(folder);
    char name[32];
    std::snprintf(name, sizeof name, "/%06u.jpg", data.frames()[view.frame].number);
    dataset::write_picture(folder + name, picture);
  };
  const bool draws = !arguments.no_pictures;
  const dataset::CaptureCheck check = dataset::check_capture(
      data, package.body(), arguments.frames,
      draws ? std::function<void(const dataset::ViewCheck&, const ports::ImageU8&)>(draw)
            : nullptr);
  std::printf("%-20s %6s %8s %13s %15s %10s %10s\n", "camera", "views", "overlap", "body in mask",
              "joints in mask", "off by px", "sharpness");
  for (const dataset::CameraCheck& camera : check.cameras) {
    const dataset::ViewCheck& mean = camera.mean;
    std::printf("%-20s %6zu %7.0f%% %12.0f%% %14.0f%% %10.1f %10.1f%s%s\n",
                data.cameras()[camera.camera].name.c_str(), camera.views, 100 * mean.overlap,
                100 * mean.body_in_mask, 100 * mean.joints_in_mask, mean.joint_distance_px,
                mean.sharpness, camera.trouble.empty() ? "" : "  ", camera.trouble.c_str());
  }
  if (draws) ports::say("pictures in " + arguments.output);
  if (check.misfits() > 0) {
    throw InputError(arguments.data + ": " + std::to_string(check.misfits()) + " of " +
                     std::to_string(check.cameras.size()) + " cameras do not fit the poses");
  }
}

}  // namespace

void add_check_capture_command(CLI::App& app) {
  auto arguments = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand(
      "check-capture",
      "Draw the posed body over the views of a capture; say how cameras, poses and masks fit");
  command->add_option("data", arguments->data, "DIR of one person, in either layout")->required();
  command->add_option("--body", arguments->body, "BODY.fgn that the poses are of")->required();
  command->add_option("--frames", arguments->frames, "So many, spread over the capture; 0: all")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output,
                      "Folder for the pictures (default: DIR_check)");
  command->add_flag("--no-pictures", arguments->no_pictures, "Only the table");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace figurine::cli
