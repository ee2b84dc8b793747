// figurine-train evaluate features: how well networks compare people.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/command_line/values.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/features/retrieval.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

struct FeaturesArguments {
  std::string population, body, motion, output;
  features::NetworkFiles files;
  features::RetrievalOptions options;
};

void print_found(const char* part, const nlohmann::json& found) {
  std::printf(
      "%s members, the same person among %d in another pose from another side (chance %.1f %%)\n",
      part, found.at("members").get<int>(), 100 * found.at("chance").get<double>());
  std::printf("  %-44s %5.1f %%\n", "pixels", 100 * found.at("pixels").get<double>());
  for (const char* kind : {"features", "distance"}) {
    for (const auto& [name, share] : found.at(kind).items()) {
      std::printf("  %-44s %5.1f %%\n", (name + ", " + kind).c_str(), 100 * share.get<double>());
    }
  }
}

void print_features(const nlohmann::json& report) {
  print_found("held-out", report.at("held_out"));
  print_found("training", report.at("training"));
  for (const auto& [name, scale] : report.at("scale").items()) {
    std::printf("%s: another person %.3f, another pose %.3f", name.c_str(),
                scale.at("other_person_same_shot").get<double>(),
                scale.at("same_person_other_shot").get<double>());
    for (const nlohmann::json& row : scale.at("blur")) {
      std::printf(", blur %.1f px %.3f", row.at("deviation_px").get<double>(),
                  row.at("distance").get<double>());
    }
    for (const nlohmann::json& row : scale.at("noise")) {
      std::printf(", noise %.2f %.3f", row.at("deviation").get<double>(),
                  row.at("distance").get<double>());
    }
    std::printf("\n");
  }
}

void run(const FeaturesArguments& arguments) {
  const features::ComparingNetworks networks = features::open_networks(arguments.files);
  if (networks.features.empty() && networks.perceptual.empty()) {
    throw InputError("no network: give --features, --lpips or --inception");
  }
  const train::PackageFile population = train::open_population(arguments.population);
  const train::PackageFile body = train::open_package(arguments.body, PackageKind::kBody);
  std::optional<train::PackageFile> motion;
  features::RetrievalOptions options = arguments.options;
  if (!arguments.motion.empty()) {
    motion.emplace(train::open_package(arguments.motion, PackageKind::kMotion));
    throw_if_error(check_motion_fits_body(motion->package.motion(), body.package.body()),
                   arguments.motion);
    options.motion = &motion->package.motion();
  }
  nlohmann::json report{{"command", train::current_command()},
                        {"commit", train::current_commit()},
                        {"machine", train::describe_machine()},
                        {"date", train::utc_now()},
                        {"package", arguments.population},
                        {"package_hash", format_hash(population.package.content_hash())}};
  report.update(features::evaluate_networks(population.package, body.package, networks, options));
  train::write_json(arguments.output, report);
  if (!options.quiet) print_features(report);
}

}  // namespace

void add_evaluate_features_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<FeaturesArguments>();
  arguments->options.threads = model::default_threads();
  CLI::App* command = evaluate.add_subcommand(
      "features", "How well networks find people again in other poses, against chance and pixels");
  command
      ->add_option("POPULATION", arguments->population,
                   "Population package; its held-out members are judged by")
      ->required();
  command->add_option("--body", arguments->body, "Body package of its members")->required();
  command->add_option("--features", arguments->files.features,
                      "figurine-features (figurine-train features)");
  command->add_option("--lpips", arguments->files.lpips,
                      "AlexNet with LPIPS' weights, .npz or TorchScript (docs/features.md)");
  command->add_option("--inception", arguments->files.inception,
                      "Inception for FID and KID, TorchScript (docs/features.md)");
  command->add_option("--motion", arguments->motion,
                      "Motion package whose poses are drawn (default: golden poses of members)");
  command
      ->add_option("--first-pose", arguments->options.first_pose,
                   "Of the fixed poses (default 8: behind those of features)")
      ->check(ports::between(0, 64));
  command->add_option("--poses", arguments->options.poses, "Default 3")
      ->check(ports::between(2, 64));
  command->add_option("--views", arguments->options.views, "Of every pose (default 3)")
      ->check(ports::between(2, 64));
  command->add_option("-o,--output", arguments->output, "Report to write, JSON")->required();
  add_threads_option(*command, arguments->options.threads, "Default: all cores");
  command->add_flag("--quiet", arguments->options.quiet, "No progress, no summary");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace figurine::cli
