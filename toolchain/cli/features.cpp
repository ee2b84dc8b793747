// figurine-train features: the network through which pictures of avatars are compared.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>

#include "ports/command_line/values.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/features/feature_trainer.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

void run(features::FeatureRequest request) {
  if (std::filesystem::path(request.output).extension() != ".safetensors") {
    throw InputError("--output: '" + request.output + "' must end in .safetensors");
  }
  request.command = train::current_command();
  const features::FeatureResult result = features::train_features(request);
  if (request.quiet) return;
  ports::sayf("%s: %s%llu iterations in %.0f s, loss %.3f, %.1f %% of training pictures told right",
              request.output.c_str(), result.was_finished ? "was finished: " : "",
              static_cast<unsigned long long>(result.iteration), result.seconds, result.loss,
              100 * result.accuracy);
}

}  // namespace

void add_features_command(CLI::App& app) {
  auto request = std::make_shared<features::FeatureRequest>();
  features::FeatureSettings& settings = request->settings;
  request->threads = model::default_threads();
  CLI::App* command = app.add_subcommand(
      "features", "Train figurine-features, through which pictures of avatars are compared");
  command
      ->add_option("--population", request->population,
                   "Package to learn from: its training part alone")
      ->required();
  command->add_option("--body", request->body, "Body package of its members")->required();
  command->add_option("-o,--output", request->output, "File to write, .safetensors")->required();
  command->add_option(
      "--motion", request->motion,
      "Motion package whose poses are drawn (default: golden poses of training members)");
  command->add_option("--poses", settings.poses, "Of every member (default 8)")
      ->check(ports::between(2, 64));
  command
      ->add_option("--views", settings.views, "Of every pose (default 6, fewer for many members)")
      ->check(ports::between(2, 64));
  command->add_option("--batch", settings.batch, "Pictures an iteration (default 48)")
      ->check(ports::between(1, 4096));
  command->add_option("--iterations", settings.schedule.budget.iterations, "Default 1200")
      ->check(ports::between(1u, 1u << 24));
  command
      ->add_option("--learning-rate", settings.schedule.peak,
                   "Of AdamW, at its highest (default 2e-3)")
      ->check(ports::between(1e-9, 1.0));
  command->add_option("--weight-decay", settings.weight_decay, "Of AdamW (default 0.01)")
      ->check(ports::between(0.0, 10.0));
  command->add_option("--seed", settings.seed,
                      "Of weights, cameras, order and augmentation (default 1)");
  add_threads_option(*command, request->threads,
                     "Default: all cores; the result does not depend on it");
  command->add_flag("--resume", request->resume,
                    "Go on from the checkpoint beside the output, by its own settings");
  command->add_flag("--quiet", request->quiet, "No progress, no summary");
  command->callback([request] { run(*request); });
}

}  // namespace figurine::cli
