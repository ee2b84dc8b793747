#include "toolchain/generate/pack_sampler.h"

#include <nlohmann/json.hpp>

#include "figurine/check.h"
#include "formats/writer/package_writer.h"
#include "formats/writer/sampler_writer.h"
#include "toolchain/error.h"
#include "toolchain/generate/activation_ranges.h"
#include "toolchain/generate/quantised_sampler.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/run_directory.h"

namespace figurine::generate {

namespace {

// Licence and sources are the population's: what is sampled is made of them.
Provenance make_provenance(const PackSamplerOptions& options, const TrainedSampler& trained,
                           const ActivationRanges& ranges) {
  const train::RunDirectory run{options.run};
  const nlohmann::json json = train::read_json(run.run_json());
  Provenance provenance = trained.population->package.provenance();
  provenance.tool = "figurine-train " FIGURINE_VERSION;
  provenance.created = train::utc_now().substr(0, 10);
  provenance.quality.clear();
  provenance.settings.clear();
  for (const char* key : {"command", "commit"})
    provenance.settings.push_back({key, json.value(key, "")});
  const nlohmann::json settings = to_json(trained.settings);
  for (const auto& [key, value] : settings.items()) {
    if (key == "iterations" || key == "seconds")
      continue;  // the budget; what was done is told below
    if (!value.is_structured())
      provenance.settings.push_back(
          {key, value.is_string() ? value.get<std::string>() : value.dump()});
  }
  for (const char* key : {"training_members", "dimension", "iterations", "train_seconds", "loss",
                          "validation_loss"}) {
    if (json.contains(key)) provenance.settings.push_back({key, json.at(key).dump()});
  }
  provenance.settings.push_back(
      {"population", format_hash(trained.population->package.content_hash())});
  provenance.settings.push_back(
      {"fixed_point.calibration", quantize::describe(options.calibration)});
  provenance.settings.push_back(
      {"fixed_point.calibration_members", std::to_string(ranges.members)});
  provenance.settings.push_back({"fixed_point.calibration_poses", std::to_string(ranges.poses)});
  return provenance;
}

// Sound JSON in one line, as the package keeps it.
std::string read_report(const std::string& path) {
  return path.empty() ? std::string() : train::read_json(path).dump();
}

}  // namespace

std::vector<std::byte> pack_sampler(const PackSamplerOptions& options) {
  if (options.body.empty()) {
    throw InputError(
        options.run +
        ": say --body: the activation ranges are found by posing the population's members");
  }
  model::use_threads(options.threads);
  const TrainedSampler trained =
      TrainedSampler::open(options.run, options.population, options.body);
  const Population& population = trained.population->package.population();
  const train::PackageFile body = train::open_package(options.body, PackageKind::kBody);
  const ActivationRanges ranges = observe_training_members(
      population, body.package, options.calibration_poses, options.calibration, options.quiet);
  QuantisedSampler quantised(trained, ranges.values,
                             options.name.empty() ? population.name : options.name);
  const std::string report = read_report(options.report);
  Sampler& sampler = quantised.view();
  sampler.steps = options.steps, sampler.method = options.method, sampler.report = report;
  NewSampler package{.sampler = &sampler,
                     .budget = trained.population->package.budget(),
                     .provenance = make_provenance(options, trained, ranges)};

  // Written twice: the first copy is sampled from, as a device would, and says what its golden
  // seeds are.
  if (options.golden_seeds > 0) {
    FIG_CHECK(options.sample_on_device != nullptr, "golden seeds need a device to sample them");
    const AlignedBytes draft(value_or_throw(write_sampler(package), options.run));
    const Package opened = value_or_throw(Package::open(draft.bytes(), options.run), options.run);
    sampler.golden_seeds = options.sample_on_device(opened.sampler(), options.golden_seeds);
  }
  return value_or_throw(write_sampler(package), options.run);
}

}  // namespace figurine::generate
