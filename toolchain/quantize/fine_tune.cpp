#include "toolchain/quantize/fine_tune.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "toolchain/error.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/trainer.h"

namespace figurine::quantize {

namespace {

namespace fs = std::filesystem;

constexpr uint64_t kRampIterations = 20;

// What decides the result beside the data: an earlier fine-tune with the same is still good.
nlohmann::json describe_source(const train::RunDescription& run, const FineTuneOptions& options) {
  return {{"run_updated", run.json.value("updated", "")},
          {"run_iterations", run.json.value("iterations", uint64_t{0})},
          {"calibration", describe(options.calibration)},
          {"calibration_poses", options.calibration.poses},
          {"iterations", options.iterations},
          {"learning_rate", options.learning_rate}};
}

// True if `folder` holds a run, begun or finished, with this source.
bool goes_on(const std::string& folder, const std::string& scales, const nlohmann::json& source) {
  const std::string description = train::RunDirectory{folder}.run_json();
  if (!fs::exists(description) || !fs::exists(scales)) return false;
  return train::read_json(description).value("fine_tune", nlohmann::json()) == source;
}

train::TrainSettings fine_tune_settings(const train::TrainSettings& of_run,
                                        const std::string& weights,
                                        const FineTuneOptions& options) {
  train::TrainSettings settings = of_run;
  settings.init = weights;
  settings.schedule = {.peak = options.learning_rate,
                       .ramp_iterations = kRampIterations,
                       .floor_fraction = 0,
                       .budget = {.iterations = options.iterations, .seconds = 0}};
  settings.warmup_iterations = 0;
  settings.static_learning_rate =
      0;                         // the run's own, rounded: a package has one for both precisions
  settings.standoff_weight = 0;  // what stands off has been found
  settings.perceptual = {};      // rounding is to be undone, not detail to be found
  settings.freeze_network = false, settings.adapter = {};  // rounding the network is what this is
                                                           // about
  settings.bf16 = false;
  settings.threads = options.threads;
  return settings;
}

}  // namespace

FineTuned fine_tune(train::TrainedAvatar& avatar, const train::RunDirectory& run,
                    const FineTuneOptions& options) {
  const train::RunDirectory tuned{run.path + "/qat"};
  const std::string scales_file = tuned.path + "/scales.safetensors";
  const train::RunDescription& description = avatar.description();
  const nlohmann::json source = describe_source(description, options);
  std::vector<float> storage;
  const Network network = avatar.model().unet().export_network(storage);
  const bool resume = goes_on(tuned.path, scales_file, source);
  if (!resume) {
    fs::remove_all(tuned.path);
    fs::create_directories(tuned.path);
    save_scales(scales_file,
                choose_scales(network, observe_activations(avatar, options.calibration.poses),
                              options.calibration));
  }
  FineTuned result{tuned.weights(), load_scales(scales_file, network)};
  const train::TrainRequest request{
      .data = description.data,
      .body = description.body,
      .run = tuned.path,
      .settings = fine_tune_settings(description.settings, run.weights(), options),
      .command = train::current_command(),
      .resume = resume,
      .quiet = options.quiet,
      .fake_quantisation = fake_quantisation(result.scales),
      .notes = {{"fine_tune", source}}};
  train::train_avatar(request);
  return result;
}

}  // namespace figurine::quantize
