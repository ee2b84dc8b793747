// What a sampler's training is told to do: everything that, with the population, decides the
// denoiser's weights. Kept in RUN/run.json.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "figurine/detail/noise_level.h"
#include "toolchain/generate/model_space.h"
#include "toolchain/generate/transformer.h"
#include "toolchain/train/schedule.h"

namespace figurine::generate {

// A named size of the transformer.
struct TransformerPreset {
  const char* name;
  int64_t d_model, blocks, heads, feed_forward;
};

// `paper` is the paper's; `device` is what ships (with the variant `basis`); `small` is for `nano`,
// where hundreds of runs are compared.
inline constexpr TransformerPreset kTransformerPresets[] = {
    {"small", 128, 4, 8, 512}, {"device", 256, 12, 16, 1024}, {"paper", 512, 12, 16, 2048}};
const TransformerPreset& find_transformer_preset(
    const std::string& name);  // throws InputError naming the known ones

// Of the autoencoder of variant `latent`, which is trained before the denoiser, on the same
// batches' size and with the same betas.
struct AutoencoderSettings {
  int64_t channels = 4;     // of the latent map
  double kl_weight = 1e-3;  // against the mean square error of a standardised value
  train::Schedule schedule{.peak = 1e-3,
                           .ramp_iterations = 100,
                           .floor_fraction = 0.02,
                           .budget = {.iterations = 4000, .seconds = 0}};
};

struct SamplerSettings {
  ModelSpaceOptions space;
  AutoencoderSettings autoencoder;   // of variant `latent` alone
  TransformerShape shape;            // token_sizes follow from the space
  uint32_t members = 0;              // the first so many training members; 0: all
  size_t pieces = 1;                 // of a static group's grid (measure::WeightLayout)
  double mixed_share = 0;            // of a batch: people mixed by part (people_mixer.h)
  double clean_snr = 1e4;            // where sampling ends: 40 dB, below the rounding of int8
  double noisy_dimension_snr = 0.1;  // D x SNR where it begins (figurine/detail/noise_level.h)
  uint32_t batch = 32;
  double ema = 0.999;  // decay of the moving average of the weights, which is what is kept
  uint64_t seed = 1;
  bool bf16 = false;
  uint32_t threads = 1;
  double beta1 = 0.9, beta2 = 0.999, weight_decay = 0;
  double dropout = 0;  // of what the transformer's blocks add
  train::Schedule schedule{.peak = 2e-4,
                           .ramp_iterations = 200,
                           .floor_fraction = 0.02,
                           .budget = {.iterations = 10000, .seconds = 0}};
};

// Of a space whose vectors have so many varying values. Throws InputError if there is none with
// these ends.
NoiseSchedule noise_schedule(const SamplerSettings& settings, size_t dimension);

nlohmann::json to_json(const SamplerSettings& settings);
// Throws InputError "where: reason".
SamplerSettings sampler_settings_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace figurine::generate
