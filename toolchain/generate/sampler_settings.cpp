#include "toolchain/generate/sampler_settings.h"

#include <nlohmann/json.hpp>

#include "toolchain/error.h"

namespace figurine::generate {

const TransformerPreset& find_transformer_preset(const std::string& name) {
  std::string known;
  for (const TransformerPreset& preset : kTransformerPresets) {
    if (name == preset.name) return preset;
    known += std::string(known.empty() ? "" : ", ") + preset.name;
  }
  throw InputError("sampler size '" + name + "' is none of " + known);
}

NoiseSchedule noise_schedule(const SamplerSettings& settings, size_t dimension) {
  return value_or_throw(NoiseSchedule::create({.dimension = dimension,
                                               .noisy_dimension_snr = settings.noisy_dimension_snr,
                                               .clean_snr = settings.clean_snr}),
                        "sampler");
}

nlohmann::json to_json(const SamplerSettings& settings) {
  const train::Schedule& schedule = settings.schedule;
  nlohmann::json json = {{"variant", to_string(settings.space.variant)},
                         {"rank", settings.space.rank},
                         {"chunk", settings.space.chunk},
                         {"shape", to_json(settings.shape)},
                         {"members", settings.members},
                         {"pieces", settings.pieces},
                         {"mixed_share", settings.mixed_share},
                         {"clean_snr", settings.clean_snr},
                         {"noisy_dimension_snr", settings.noisy_dimension_snr},
                         {"batch", settings.batch},
                         {"ema", settings.ema},
                         {"seed", settings.seed},
                         {"bf16", settings.bf16},
                         {"threads", settings.threads},
                         {"beta1", settings.beta1},
                         {"beta2", settings.beta2},
                         {"weight_decay", settings.weight_decay},
                         {"dropout", settings.dropout},
                         {"learning_rate", schedule.peak},
                         {"ramp_iterations", schedule.ramp_iterations},
                         {"floor_fraction", schedule.floor_fraction},
                         {"iterations", schedule.budget.iterations},
                         {"seconds", schedule.budget.seconds}};
  if (settings.space.variant == Variant::kLatent) {
    json["autoencoder"] = {{"channels", settings.autoencoder.channels},
                           {"kl_weight", settings.autoencoder.kl_weight},
                           {"learning_rate", settings.autoencoder.schedule.peak},
                           {"iterations", settings.autoencoder.schedule.budget.iterations}};
  }
  return json;
}

SamplerSettings sampler_settings_from_json(const nlohmann::json& json, const std::string& where) {
  SamplerSettings settings;
  try {
    settings.space.variant = variant_from_string(json.at("variant").get<std::string>());
    settings.space.rank = json.at("rank").get<size_t>(),
    settings.space.chunk = json.at("chunk").get<size_t>();
    settings.shape = shape_from_json(json.at("shape"), where);
    settings.members = json.at("members").get<uint32_t>();
    settings.pieces = json.value("pieces", size_t{1});
    settings.mixed_share = json.value("mixed_share", 0.0);  // older runs mixed nobody
    settings.clean_snr = json.at("clean_snr").get<double>(),
    settings.noisy_dimension_snr = json.at("noisy_dimension_snr").get<double>();
    settings.batch = json.at("batch").get<uint32_t>(), settings.ema = json.at("ema").get<double>();
    settings.seed = json.at("seed").get<uint64_t>(), settings.bf16 = json.at("bf16").get<bool>();
    settings.threads = json.at("threads").get<uint32_t>();
    settings.beta1 = json.at("beta1").get<double>(),
    settings.beta2 = json.at("beta2").get<double>();
    settings.weight_decay = json.at("weight_decay").get<double>();
    settings.dropout = json.value("dropout", 0.0);
    settings.schedule.peak = json.at("learning_rate").get<double>();
    settings.schedule.ramp_iterations = json.at("ramp_iterations").get<uint64_t>();
    settings.schedule.floor_fraction = json.at("floor_fraction").get<double>();
    if (settings.space.variant == Variant::kLatent) {
      const nlohmann::json& autoencoder = json.at("autoencoder");
      settings.autoencoder.channels = autoencoder.at("channels").get<int64_t>();
      settings.autoencoder.kl_weight = autoencoder.at("kl_weight").get<double>();
      settings.autoencoder.schedule.peak = autoencoder.at("learning_rate").get<double>();
      settings.autoencoder.schedule.budget = {
          .iterations = autoencoder.at("iterations").get<uint64_t>(), .seconds = 0};
    }
    settings.schedule.budget = {.iterations = json.at("iterations").get<uint64_t>(),
                                .seconds = json.at("seconds").get<double>()};
  } catch (const nlohmann::json::exception& error) {
    throw InputError(where + ": " + error.what());
  }
  return settings;
}

}  // namespace figurine::generate
