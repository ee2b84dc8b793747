// What one avatar's training is told to do: everything that, with the data, decides the weights.
// Kept in RUN/run.json.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "figurine/avatar.h"
#include "toolchain/model/compose.h"
#include "toolchain/model/network_adapter.h"
#include "toolchain/train/schedule.h"

namespace figurine::train {

struct Preset {
  const char* name;
  uint32_t uv_size;          // T
  uint32_t channels;         // C
  uint32_t sh_degree;        // d
  uint32_t fourier_octaves;  // constant input channels: 4 per octave; 0: as in the paper
  uint32_t network_step;     // T / T_n
  double learning_rate;      // of the network
  const char* static_grids;  // as parse_static_grids reads it
  bool antialiased;          // splats, in training and ever after
};

inline constexpr std::array<Preset, 4> kPresets{
    {{"nano", 32, 8, 0, 5, 1, 2e-3, "none", false},
     {"edge", 128, 32, 0, 5, 2, 1e-3, "all:T", true},
     {"fine", 256, 32, 0, 5, 4, 1e-3, "colour:T,rest:T/2", true},  // faces from near by, fine cloth
     {"paper", 256, 64, 3, 0, 1, 2e-3, "none", false}}};

// Throws InputError naming the known ones.
const Preset& find_preset(const std::string& name);

// What lies behind prediction and truth in the loss. Behind dark clothes black hides every fault of
// the outline, which grey shows.
enum class TrainingBackground : uint8_t { kBlack, kGrey, kRandom };

// What updates the kernels of the hidden convolutions; biases and the head are AdamW's either way
// (toolchain/model/optimiser.h).
enum class OptimiserKind : uint8_t { kAdamW, kMuon };

// Static channels on one grid.
struct StaticGrid {
  std::string channels;  // all, colour, rest (all but colour), geometry (offset, scale and
                         // rotation), offset, scale, rotation, opacity
  uint32_t step = 1;     // T / G: texels a cell has, a side
};

// The perceptual term of the loss (toolchain/model/perceptual.h).
struct PerceptualSettings {
  std::string file;          // of the network; empty: no such term
  std::string name, hash;    // of the network, of its file
  float weight = 0.01f;      // the paper's, for LPIPS
  uint32_t window_px = 128;  // side of what it looks at, around a random pixel of the person in
                             // every picture; 0: all that the rest of the loss sees
};

// What a person may change of a network that stays (toolchain/model/network_adapter.h).
struct AdapterSettings {
  model::AdapterKind kind = model::AdapterKind::kResidual;
  uint32_t rank = 0;  // 0: nothing
  std::string basis;  // of kBasis: file (kernel_basis_file.h)
};

struct TrainSettings {
  std::string preset = "edge";
  uint32_t uv_size = 0;       // T; 0: the preset's
  bool network = true;        // without one the static values are all there is
  uint32_t network_size = 0;  // T_n: T / 1, 2, 4 or 8; 0: T
  uint32_t channels = 0;      // C; 0: the preset's
  TemplateMode template_mode = TemplateMode::kShaped;
  bool freeze_pose = false;  // the network sees the rest pose in the true root orientation; the
                             // Gaussians are skinned with the true pose
  uint32_t fourier_octaves = 5;
  HeadDecoding decoding{.spacing_scale = 0.45f};

  uint64_t seed = 1;  // of the order of the images; initial weights are the same for all avatars
                      // (kInitialWeightsSeed, or --init)
  std::string init;   // weights or run to start from; empty: the common initial weights
  bool freeze_network = false;  // of init: only the static values learn
  AdapterSettings adapter;      // of a frozen network; learns beside the static values
  Schedule schedule{.peak = 2e-3,
                    .ramp_iterations = 50,
                    .floor_fraction = 0.02,
                    .budget = {.iterations = 0, .seconds = 600}};
  std::vector<StaticGrid> static_grids;  // values a texel owns whatever the pose
  model::StaticColour static_colour = model::StaticColour::kGain;  // packages hold gains alone
  double static_learning_rate = 1.5e-2;  // peak of AdamW for the static values, on the network's
                                         // schedule; 0: they stay
  double static_penalty = 0;     // weight of the static values' mean square in the loss: what the
                                 // network can say as well it says
  double clip_gradient = 0;      // largest norm of all gradients together; 0: none
  bool smallest_extent = false;  // no Gaussian below what the sharpest view resolved
                                 // (smallest_extent.h)
  bool antialiased = false;      // SplatOptions::antialiased, in training and ever after
  OptimiserKind optimiser = OptimiserKind::kMuon;
  // AdamW's. An epsilon of 1e-8 would swallow the small gradients of a mean loss.
  double beta1 = 0.9, beta2 = 0.999, epsilon = 1e-10, weight_decay = 0;
  bool bf16 = false;  // arithmetic of the convolutions while training; weights, head and evaluation
                      // are float
  uint32_t threads = 1;
  uint32_t views_per_pose =
      1;  // images of one pose an iteration, sharing one run of the network; the paper's batch is 1
  uint32_t poses_per_iteration =
      1;  // each on its own share of the threads; their gradients are averaged
  float ssim_weight = 0.1f;
  float mask_weight = 0.1f;
  PerceptualSettings perceptual;
  float standoff_weight = 4;  // of the pull on Gaussians from mask that the picture leaves
                              // uncovered (standoff.h); 0: none
  TrainingBackground background = TrainingBackground::kGrey;
  uint32_t warmup_iterations = 0;  // of fitting reference Gaussians before the first image
  uint32_t crop_margin_px = 16;    // around the box of the true mask
  uint32_t whole_image_period =
      16;  // every so many iterations the loss sees the whole image; 0: never
};

// All avatars of a population start from the same weights (paper, section 4.1).
inline constexpr uint64_t kInitialWeightsSeed = 0;

uint32_t input_channels(const TrainSettings& settings);
uint32_t texel_side(const TrainSettings& settings);        // T
uint32_t network_side(const TrainSettings& settings);      // T_n; 0 without a network
uint32_t network_channels(const TrainSettings& settings);  // C
// Shapes only; without layers where there is no network.
Network make_network(const TrainSettings& settings);
// The settings must be sound (check_parts).
model::HeadLayout head_layout(const TrainSettings& settings);

// "colour:T,rest:T/2", or "none". Throws InputError "where: reason".
std::vector<StaticGrid> parse_static_grids(const std::string& text, const std::string& where);
std::string to_string(const std::vector<StaticGrid>& grids);

// Throws InputError "where: FIELD: reason" unless network and static grids fit T and each other.
void check_parts(const TrainSettings& settings, const std::string& where);

// What a preset says of itself, all else as above.
TrainSettings preset_settings(const std::string& name);
// The same with a network for all texels, no static values and not antialiased: what a population's
// members are.
TrainSettings network_alone(TrainSettings settings);

// bf16 where the CPU multiplies it in hardware, float elsewhere.
bool has_fast_bf16();

const char* to_string(TrainingBackground background);
const char* to_string(TemplateMode mode);
const char* to_string(OptimiserKind kind);
const char* to_string(model::StaticColour colour);
using model::to_string;  // of AdapterKind

nlohmann::json to_json(const TrainSettings& settings);
// Throws InputError "where: FIELD: reason".
TrainSettings settings_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace figurine::train
