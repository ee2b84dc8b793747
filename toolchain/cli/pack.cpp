// figurine-train pack: a run as an avatar or sampler package, or many avatars as a population
// package.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>

#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/generate/pack_sampler.h"
#include "toolchain/generate/sampler_trainer.h"
#include "toolchain/model/threads.h"
#include "toolchain/quantize/fine_tune.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/pack_population.h"
#include "toolchain/verify/golden_seeds.h"
#include "toolchain/verify/parity.h"

namespace figurine::cli {

namespace {

struct PackArguments {
  train::OpenRunOptions open;
  train::PackOptions pack;
  std::vector<std::string> inputs;
  bool is_population = false, no_network = false;
  train::PackPopulationOptions population;
  std::string precision, output;
  bool fine_tune = false;
  quantize::FineTuneOptions fine_tuning;
  generate::PackSamplerOptions sampler;
  std::string solver;
};

// Package bytes must be aligned as a memory map is.
class AlignedCopy {
 public:
  explicit AlignedCopy(std::span<const std::byte> bytes) : storage_(bytes.size() + kBlobAlignment) {
    void* start = storage_.data();
    size_t space = storage_.size();
    start_ = static_cast<std::byte*>(std::align(kBlobAlignment, bytes.size(), start, space));
    size_ = bytes.size();
    std::copy(bytes.begin(), bytes.end(), start_);
  }
  std::span<const std::byte> bytes() const { return {start_, size_}; }

 private:
  std::vector<std::byte> storage_;
  std::byte* start_ = nullptr;
  size_t size_ = 0;
};

// The run's network in fixed point: fine-tuned for it, or its weights as they are. Says in
// `settings` how it was made.
quantize::QuantisedNetwork quantise(const PackArguments& arguments, train::TrainedAvatar& avatar,
                                    std::vector<KeyValue>& settings) {
  const quantize::FineTuneOptions& fine_tuning = arguments.fine_tuning;
  model::PoseUNet& unet = avatar.model().unet();
  std::vector<float> storage, tuned_storage;
  const Network network = unet.export_network(storage);
  settings.push_back({"fixed_point.calibration", quantize::describe(fine_tuning.calibration)});
  settings.push_back(
      {"fixed_point.calibration_poses", std::to_string(fine_tuning.calibration.poses)});
  settings.push_back({"fixed_point.qat_iterations",
                      std::to_string(arguments.fine_tune ? fine_tuning.iterations : 0)});
  if (!arguments.fine_tune) {
    const quantize::ActivationStatistics statistics =
        quantize::observe_activations(avatar, fine_tuning.calibration.poses);
    return {network, quantize::choose_scales(network, statistics, fine_tuning.calibration)};
  }
  const quantize::FineTuned tuned = quantize::fine_tune(avatar, {arguments.open.run}, fine_tuning);
  train::load_weights(tuned.weights, unet);
  const quantize::QuantisedNetwork quantised(unet.export_network(tuned_storage), tuned.scales);
  unet.import_network(network);
  return quantised;
}

void run_population(PackArguments arguments) {
  train::PackPopulationOptions& options = arguments.population;
  options.inputs = arguments.inputs;
  options.coding = arguments.precision == "f16" ? DifferenceCoding::kHalf : DifferenceCoding::kInt8;
  options.threads = arguments.open.threads;
  if (!arguments.pack.name.empty()) options.name = arguments.pack.name;
  const std::vector<std::byte> bytes = train::pack_population(options);
  throw_if_error(ports::write_file_atomically(arguments.output, bytes), "cannot save");
  ports::sayf("%s: %zu bytes", arguments.output.c_str(), bytes.size());
}

void run_avatar(PackArguments arguments) {
  arguments.open.run = arguments.inputs.front();
  train::TrainedAvatar avatar = train::TrainedAvatar::open(arguments.open);
  if (!avatar.model().has_network() && (arguments.precision != "f32" || arguments.fine_tune)) {
    throw InputError(arguments.open.run +
                     ": has no network; --precision and --qat say how to round one (static values "
                     "are in 8 bits anyway)");
  }
  std::optional<quantize::QuantisedNetwork> quantised;
  if (arguments.precision != "f32") {
    arguments.fine_tuning.threads = arguments.open.threads;
    quantised = quantise(arguments, avatar, arguments.pack.settings);
    arguments.pack.fixed_point = quantised->view();
    arguments.pack.float_weights = arguments.precision != "q8";
  } else if (arguments.fine_tune) {
    throw InputError("--qat: is for --precision q8");
  }
  const train::RunDirectory folder{arguments.open.run};
  if (arguments.no_network) {
    arguments.pack.network = false;
    const std::vector<std::byte> bytes = train::pack_avatar(avatar, folder, arguments.pack);
    throw_if_error(ports::write_file_atomically(arguments.output, bytes), "cannot save");
    ports::sayf("%s: %zu bytes, for a population that has the network", arguments.output.c_str(),
                bytes.size());
    return;
  }
  // Written twice: the first copy runs on the device's renderer, which then says how much memory it
  // held and what it drew.
  train::PackOptions options = arguments.pack;
  const AlignedCopy draft(train::pack_avatar(avatar, folder, options));
  const Package opened =
      value_or_throw(Package::open(draft.bytes(), arguments.output), arguments.output);
  const verify::GoldenRun golden = verify::draw_golden_frame(opened, avatar.body_file().package);
  options.peak_memory_bytes = golden.memory_bytes;
  options.fixed_point_hash = golden.fixed_point_hash;
  if (quantised) options.fixed_point_library = golden.library;
  const std::vector<std::byte> bytes = train::pack_avatar(avatar, folder, options);
  throw_if_error(ports::write_file_atomically(arguments.output, bytes), "cannot save");
  ports::sayf("%s: %zu bytes, %.0f kB of memory on the device", arguments.output.c_str(),
              bytes.size(), static_cast<double>(options.peak_memory_bytes) / 1e3);
}

void run_sampler(const PackArguments& arguments) {
  generate::PackSamplerOptions options = arguments.sampler;
  options.run = arguments.inputs.front();
  options.body = arguments.open.body;
  options.name = arguments.pack.name;
  options.threads = arguments.open.threads;
  options.sample_on_device = verify::sample_golden_seeds;
  if (arguments.solver == "ddim") options.method = SolverMethod::kDdim;
  const std::vector<std::byte> bytes = generate::pack_sampler(options);
  throw_if_error(ports::write_file_atomically(arguments.output, bytes), "cannot save");
  ports::sayf("%s: %zu bytes", arguments.output.c_str(), bytes.size());
}

bool is_sampler(const std::vector<std::string>& inputs) {
  return inputs.size() == 1 && generate::is_sampler_run(inputs.front());
}

// What CLI11 cannot see: which options belong to which of the three.
void run(const PackArguments& arguments) {
  PackArguments chosen = arguments;
  if (!chosen.is_population && is_sampler(chosen.inputs)) {
    if (!chosen.precision.empty() && chosen.precision != "q8")
      throw CLI::ValidationError("--precision", "a sampler is q8");
    return run_sampler(chosen);
  }
  if (chosen.precision.empty()) chosen.precision = chosen.is_population ? "q8" : "f32";
  const bool fits = chosen.is_population ? chosen.precision == "q8" || chosen.precision == "f16"
                                         : chosen.precision != "f16";
  if (!fits)
    throw CLI::ValidationError("--precision", chosen.is_population ? "q8 or f16 with --population"
                                                                   : "f16 is for --population");
  if (!chosen.is_population && chosen.inputs.size() != 1)
    throw CLI::ValidationError("RUN", "one; several are for --population");
  chosen.is_population ? run_population(std::move(chosen)) : run_avatar(std::move(chosen));
}

}  // namespace

void add_pack_command(CLI::App& app) {
  auto arguments = std::make_shared<PackArguments>();
  arguments->open.threads = model::default_threads();
  CLI::App* command = app.add_subcommand(
      "pack", "Write a run's avatar or sampler as a package, or many avatars as a population");
  command
      ->add_option("RUN", arguments->inputs,
                   "Folder of a run; with --population also avatar packages, and folders of them")
      ->required();
  command->add_option("-o,--output", arguments->output, "Package to write")->required();
  command->add_option("--data", arguments->open.data,
                      "Where the data is now (default: where the run found it)");
  command->add_option("--body", arguments->open.body,
                      "Where the body is now (default: where the run found it)");
  command
      ->add_option("--precision", arguments->precision,
                   "Float weights, fixed point or both (default f32); of a population's "
                   "differences q8 or f16 (default q8)")
      ->check(ports::one_of({"f32", "q8", "f32,q8", "f16"}));
  CLI::Option* population = command->add_flag("--population", arguments->is_population,
                                              "One package of many avatars of one network shape");
  command
      ->add_option(
          "--init", arguments->population.init,
          "Weights or run that all members started from (default: the common initial weights)")
      ->needs(population);
  command
      ->add_option("--shared", arguments->population.shared,
                   "Avatar package whose network all members have; they may be packages without "
                   "one (pack --no-network)")
      ->needs(population)
      ->excludes("--init")
      ->excludes("--precision");
  command
      ->add_flag("--no-network", arguments->no_network,
                 "Leave out the network, which the avatar has from another training (avatar "
                 "--freeze-network): what a population with --shared takes")
      ->excludes(population)
      ->excludes("--precision");
  command
      ->add_option("--levels", arguments->population.levels,
                   "Of a population's differences in q8, of either sign (default 127); fewer are "
                   "smaller and coarser")
      ->check(ports::between(1u, kMostLevels))
      ->needs(population);
  command
      ->add_option("--split", arguments->population.split,
                   "JSON of the lists train, validation and test (default: all members train)")
      ->needs(population);
  CLI::Option* qat =
      command->add_flag("--qat", arguments->fine_tune,
                        "Fine-tune for fixed point first, in RUN/qat; the run's own weights stay");
  qat->excludes(population);
  command->add_option(
      "--population-file", arguments->sampler.population,
      "Of a sampler: where its population is now (default: where the run found it)");
  command->add_option("--report", arguments->sampler.report,
                      "Of a sampler: JSON of evaluate generation, to be carried along");
  command
      ->add_option("--steps", arguments->sampler.steps,
                   "Of a sampler: evaluations where nobody says otherwise (default 20)")
      ->check(ports::between(size_t{1}, kMaxSolverSteps));
  command
      ->add_option("--solver", arguments->solver,
                   "Of a sampler: where nobody says otherwise (default dpmpp2m)")
      ->check(ports::one_of({"ddim", "dpmpp2m"}));
  command
      ->add_option("--qat-iterations", arguments->fine_tuning.iterations,
                   "Of the fine-tune (default 400)")
      ->check(ports::positive());
  add_threads_option(*command, arguments->open.threads, "Default: all cores");
  command->add_flag("--golden,!--no-golden", arguments->pack.golden,
                    "Carry an expected picture (default)");
  command->add_option("--name", arguments->pack.name,
                      "Name of the avatar (default: the identity's folder) or of the population");
  command->add_option("--licence", arguments->pack.licence_name,
                      "Licence (synthetic persons: CC0-1.0)");
  command->add_option("--licence-url", arguments->pack.licence_url, "Where its text is");
  command->add_option("--author", arguments->pack.authors,
                      "Who made it; may be given several times");
  command->add_option("--permission", arguments->pack.avatar_permission, "Who may perform with it")
      ->check(ports::one_of({"onlyAuthor", "onlySeparatelyLicensedPerson", "everyone"}));
  command->add_option("--commercial", arguments->pack.commercial_usage, "Commercial use")
      ->check(ports::one_of({"personalNonProfit", "personalProfit", "corporation"}));
  command->add_option("--depicted-person", arguments->pack.depicted_person,
                      "\"synthetic\", or how consent was given");
  // What is a run's own is said when the run is packed.
  for (const char* option :
       {"--data", "--body", "--golden", "--licence", "--licence-url", "--author", "--permission",
        "--commercial", "--depicted-person", "--qat-iterations"}) {
    command->get_option(option)->excludes(population);
  }
  command->callback([arguments] { run(*arguments); });
}

}  // namespace figurine::cli
