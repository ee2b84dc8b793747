#include "toolchain/train/settings.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "figurine/body.h"
#include "figurine/gaussian.h"
#include "toolchain/error.h"

namespace figurine::train {

namespace {

template <class Enum, size_t N>
Enum parse(const std::string& text, const std::array<Enum, N>& values, const std::string& where) {
  for (Enum value : values) {
    if (text == to_string(value)) return value;
  }
  throw InputError(where + ": unknown value \"" + text + "\"");
}

constexpr std::array kBackgrounds{TrainingBackground::kBlack, TrainingBackground::kGrey,
                                  TrainingBackground::kRandom};
constexpr std::array kOptimisers{OptimiserKind::kAdamW, OptimiserKind::kMuon};
constexpr std::array kTemplateModes{TemplateMode::kMean, TemplateMode::kShaped};
constexpr std::array kStaticColours{model::StaticColour::kGain, model::StaticColour::kSum};
constexpr std::array kAdapters{model::AdapterKind::kResidual, model::AdapterKind::kScale,
                               model::AdapterKind::kBasis};

struct ChannelRange {
  const char* name;
  uint32_t first, count;
};
// Of HeadDecoding's outputs.
constexpr ChannelRange kChannelRanges[] = {{"all", 0, kStaticChannels},
                                           {"colour", kStaticColour, 3},
                                           {"rest", 0, kStaticColour},
                                           {"geometry", 0, 10},
                                           {"offset", 0, 3},
                                           {"scale", 3, 3},
                                           {"rotation", 6, 4},
                                           {"opacity", 10, 1}};

ChannelRange find_channels(const std::string& name, const std::string& where) {
  std::string known;
  for (const ChannelRange& range : kChannelRanges) {
    if (name == range.name) return range;
    known += (known.empty() ? "" : ", ") + std::string(range.name);
  }
  throw InputError(where + ": static_grids: channels \"" + name + "\" are none of " + known);
}

constexpr uint32_t kMaxNetworkRank = 256;

void require(bool condition, const std::string& where, const char* what) {
  if (!condition) throw InputError(where + ": " + what);
}

}  // namespace

const Preset& find_preset(const std::string& name) {
  std::string known;
  for (const Preset& preset : kPresets) {
    if (name == preset.name) return preset;
    known += (known.empty() ? "" : ", ") + std::string(preset.name);
  }
  throw InputError("preset: \"" + name + "\" is none of " + known);
}

TrainSettings preset_settings(const std::string& name) {
  const Preset& preset = find_preset(name);
  TrainSettings settings;
  settings.preset = name;
  settings.fourier_octaves = preset.fourier_octaves;
  settings.decoding.sh_degree = preset.sh_degree;
  if (preset.network_step > 1) settings.network_size = preset.uv_size / preset.network_step;
  settings.schedule.peak = preset.learning_rate;
  settings.static_grids = parse_static_grids(preset.static_grids, name);
  settings.antialiased = preset.antialiased;
  return settings;
}

TrainSettings network_alone(TrainSettings settings) {
  settings.network_size = 0;
  settings.static_grids.clear();
  settings.smallest_extent = settings.antialiased = false;
  settings.schedule.peak = TrainSettings{}.schedule.peak;
  return settings;
}

uint32_t input_channels(const TrainSettings& settings) {
  return kMapChannels + 4 * settings.fourier_octaves;
}

Network make_network(const TrainSettings& settings) {
  if (!settings.network) return {};
  return make_pose_unet(network_side(settings), input_channels(settings),
                        network_channels(settings), head_channels(settings.decoding.sh_degree));
}

uint32_t texel_side(const TrainSettings& settings) {
  return settings.uv_size > 0 ? settings.uv_size : find_preset(settings.preset).uv_size;
}

uint32_t network_side(const TrainSettings& settings) {
  if (!settings.network) return 0;
  return settings.network_size > 0 ? settings.network_size : texel_side(settings);
}

uint32_t network_channels(const TrainSettings& settings) {
  return settings.channels > 0 ? settings.channels : find_preset(settings.preset).channels;
}

model::HeadLayout head_layout(const TrainSettings& settings) {
  model::HeadLayout layout{.network_size = network_side(settings),
                           .channels = head_channels(settings.decoding.sh_degree),
                           .statics = {},
                           .colour = settings.static_colour};
  for (const StaticGrid& grid : settings.static_grids) {
    const ChannelRange range = find_channels(grid.channels, "settings");
    layout.statics.push_back({range.first, range.count, texel_side(settings) / grid.step});
  }
  return layout;
}

std::vector<StaticGrid> parse_static_grids(const std::string& text, const std::string& where) {
  std::vector<StaticGrid> grids;
  if (text == "none") return grids;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    const size_t colon = part.find(':');
    const std::string size = colon == std::string::npos ? "T" : part.substr(colon + 1);
    StaticGrid grid{part.substr(0, colon), 0};
    for (const uint32_t step : {1u, 2u, 4u, 8u}) {
      if (size == (step == 1 ? "T" : "T/" + std::to_string(step))) grid.step = step;
    }
    if (grid.step == 0)
      throw InputError(where + ": static_grids: size \"" + size + "\" is none of T, T/2, T/4, T/8");
    find_channels(grid.channels, where);
    grids.push_back(grid);
    begin = end + 1;
  }
  return grids;
}

std::string to_string(const std::vector<StaticGrid>& grids) {
  std::string text;
  for (const StaticGrid& grid : grids) {
    text += (text.empty() ? "" : ",") + grid.channels +
            (grid.step == 1 ? ":T" : ":T/" + std::to_string(grid.step));
  }
  return text.empty() ? "none" : text;
}

void check_parts(const TrainSettings& settings, const std::string& where) {
  const uint32_t side = texel_side(settings), network = network_side(settings);
  require(side >= 8 && side <= kMaxUvSize, where, "uv_size: must be 8 to 1024");
  if (settings.network) {
    require(grid_fits(side, network) && network % 8 == 0, where,
            "network_size: must be T, T/2, T/4 or T/8, and a multiple of 8");
    require(settings.channels <= kMaxChannels / 2, where, "channels: more than 2048");
  } else {
    require(!settings.static_grids.empty(), where,
            "network: without one there must be static_grids");
    require(settings.network_size == 0 && settings.channels == 0, where,
            "network: none has neither network_size nor channels");
  }
  std::array<bool, kStaticChannels> taken{};
  for (const StaticGrid& grid : settings.static_grids) {
    require(grid_fits(side, side / grid.step), where, "static_grids: a cell is no whole texels");
    const ChannelRange range = find_channels(grid.channels, where);
    for (uint32_t c = range.first; c < range.first + range.count; ++c) {
      require(!taken[c], where, "static_grids: a channel is in two groups");
      taken[c] = true;
    }
  }
  if (settings.freeze_network) {
    require(settings.network && !settings.static_grids.empty(), where,
            "freeze_network: there must be a network, and static_grids to learn");
    require(!settings.init.empty(), where, "freeze_network: needs the network of an init");
  }
  const AdapterSettings& adapter = settings.adapter;
  require(adapter.rank == 0 || settings.freeze_network, where,
          "network_rank: goes with freeze_network");
  require(adapter.rank <= kMaxNetworkRank, where, "network_rank: more than 256");
  require(adapter.rank > 0 || adapter.kind == model::AdapterKind::kResidual, where,
          "network_adapter: needs a network_rank");
  require((adapter.kind == model::AdapterKind::kBasis) == !adapter.basis.empty(), where,
          "network_basis: goes with network_adapter basis, and that needs one");
  require(settings.perceptual.weight >= 0 && std::isfinite(settings.perceptual.weight), where,
          "perceptual.weight: must be finite and not negative");
  for (const double value :
       {settings.static_learning_rate, settings.static_penalty, settings.clip_gradient}) {
    require(value >= 0 && std::isfinite(value), where,
            "static_learning_rate, static_penalty, clip_gradient: must be finite and not negative");
  }
}

bool has_fast_bf16() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512bf16");
#else
  return false;
#endif
}

const char* to_string(TrainingBackground background) {
  switch (background) {
    case TrainingBackground::kBlack:
      return "black";
    case TrainingBackground::kGrey:
      return "grey";
    case TrainingBackground::kRandom:
      return "random";
  }
  return "?";
}

const char* to_string(TemplateMode mode) { return mode == TemplateMode::kMean ? "mean" : "shaped"; }

const char* to_string(model::StaticColour colour) {
  return colour == model::StaticColour::kGain ? "gain" : "sum";
}

const char* to_string(OptimiserKind kind) {
  return kind == OptimiserKind::kMuon ? "muon" : "adamw";
}

nlohmann::json to_json(const HeadDecoding& decoding) {
  nlohmann::json json{{"offset_scale_m", decoding.offset_scale_m},
                      {"spacing_scale", decoding.spacing_scale},
                      {"max_log_scale", decoding.max_log_scale},
                      {"opacity_bias", decoding.opacity_bias},
                      {"sh_degree", decoding.sh_degree}};
  if (decoding.max_offset != 0) json["max_offset"] = decoding.max_offset;
  return json;
}

nlohmann::json loss_to_json(const TrainSettings& s) {
  nlohmann::json json{{"l1", 1.0}, {"ssim", s.ssim_weight}, {"mask", s.mask_weight}};
  if (s.perceptual.file.empty()) {
    json["lpips"] = 0.0;
  } else {
    json["perceptual"] = {{"network", s.perceptual.name},
                          {"file", s.perceptual.file},
                          {"hash", s.perceptual.hash},
                          {"weight", s.perceptual.weight},
                          {"window_px", s.perceptual.window_px}};
  }
  return json;
}

void read_loss(const nlohmann::json& json, TrainSettings& s) {
  s.ssim_weight = json.at("ssim").get<float>();
  s.mask_weight = json.at("mask").get<float>();
  const auto found = json.find("perceptual");
  if (found == json.end()) return;
  s.perceptual = {.file = found->at("file").get<std::string>(),
                  .name = found->at("network").get<std::string>(),
                  .hash = found->at("hash").get<std::string>(),
                  .weight = found->at("weight").get<float>(),
                  .window_px = found->at("window_px").get<uint32_t>()};
}

// What runs before there were static parts did not say, and others need not.
void add_parts(const TrainSettings& s, nlohmann::json& json) {
  if (s.uv_size > 0) json["uv_size"] = s.uv_size;
  if (!s.network) json["network"] = "none";
  if (s.network_size > 0) json["network_size"] = s.network_size;
  if (s.channels > 0) json["channels"] = s.channels;
  if (s.clip_gradient > 0) json["clip_gradient"] = s.clip_gradient;
  if (s.smallest_extent) json["smallest_extent"] = true;
  if (s.antialiased) json["antialiased"] = true;
  if (s.freeze_network) json["freeze_network"] = true;
  if (s.adapter.rank > 0) json["network_rank"] = s.adapter.rank;
  if (s.adapter.kind != model::AdapterKind::kResidual)
    json["network_adapter"] = to_string(s.adapter.kind);
  if (!s.adapter.basis.empty()) json["network_basis"] = s.adapter.basis;
  if (s.static_grids.empty()) return;
  json["static_grids"] = to_string(s.static_grids);
  json["static_colour"] = to_string(s.static_colour);
  json["static_learning_rate"] = s.static_learning_rate;
  json["static_penalty"] = s.static_penalty;
}

void read_parts(const nlohmann::json& json, const std::string& where, TrainSettings& s) {
  s.uv_size = json.value("uv_size", 0u);
  const std::string network = json.value("network", std::string("unet"));
  require(network == "unet" || network == "none", where, "network: is neither unet nor none");
  s.network = network != "none";
  s.network_size = json.value("network_size", 0u);
  s.smallest_extent = json.value("smallest_extent", false);
  s.antialiased = json.value("antialiased", false);
  s.channels = json.value("channels", 0u);
  s.clip_gradient = json.value("clip_gradient", 0.0);
  s.freeze_network = json.value("freeze_network", false);
  s.adapter.rank = json.value("network_rank", 0u);
  s.adapter.kind = parse(json.value("network_adapter", std::string("residual")), kAdapters,
                         where + ": network_adapter");
  s.adapter.basis = json.value("network_basis", std::string());
  s.static_grids = parse_static_grids(json.value("static_grids", std::string("none")), where);
  s.static_colour = parse(json.value("static_colour", std::string("gain")), kStaticColours,
                          where + ": static_colour");
  s.static_learning_rate = json.value("static_learning_rate", s.static_learning_rate);
  s.static_penalty = json.value("static_penalty", 0.0);
}

nlohmann::json to_json(const TrainSettings& s) {
  nlohmann::json json{
      {"preset", s.preset},
      {"template", to_string(s.template_mode)},
      {"freeze_pose", s.freeze_pose},
      {"fourier_octaves", s.fourier_octaves},
      {"decoding", to_json(s.decoding)},
      {"seed", s.seed},
      {"init", s.init},
      {"learning_rate", s.schedule.peak},
      {"ramp_iterations", s.schedule.ramp_iterations},
      {"learning_rate_floor", s.schedule.floor_fraction},
      {"budget",
       {{"iterations", s.schedule.budget.iterations}, {"seconds", s.schedule.budget.seconds}}},
      {"optimiser", to_string(s.optimiser)},
      {"adamw",
       {{"beta1", s.beta1},
        {"beta2", s.beta2},
        {"epsilon", s.epsilon},
        {"weight_decay", s.weight_decay}}},
      {"precision", s.bf16 ? "bf16" : "f32"},
      {"threads", s.threads},
      {"views_per_pose", s.views_per_pose},
      {"poses_per_iteration", s.poses_per_iteration},
      {"loss", loss_to_json(s)},
      {"standoff_weight", s.standoff_weight},
      {"background", to_string(s.background)},
      {"warmup_iterations", s.warmup_iterations},
      {"crop_margin_px", s.crop_margin_px},
      {"whole_image_period", s.whole_image_period}};
  add_parts(s, json);
  return json;
}

TrainSettings settings_from_json(const nlohmann::json& json, const std::string& where) {
  TrainSettings s;
  try {
    s.preset = json.at("preset").get<std::string>();
    s.template_mode =
        parse(json.at("template").get<std::string>(), kTemplateModes, where + ": template");
    s.freeze_pose = json.at("freeze_pose").get<bool>();
    s.fourier_octaves = json.at("fourier_octaves").get<uint32_t>();
    const nlohmann::json& decoding = json.at("decoding");
    s.decoding = {.offset_scale_m = decoding.at("offset_scale_m").get<float>(),
                  .spacing_scale = decoding.at("spacing_scale").get<float>(),
                  .max_log_scale = decoding.at("max_log_scale").get<float>(),
                  .opacity_bias = decoding.at("opacity_bias").get<float>(),
                  .sh_degree = decoding.at("sh_degree").get<uint32_t>(),
                  .max_offset = decoding.value("max_offset", 0.0f)};
    s.seed = json.at("seed").get<uint64_t>();
    s.init = json.at("init").get<std::string>();
    s.schedule = {.peak = json.at("learning_rate").get<double>(),
                  .ramp_iterations = json.at("ramp_iterations").get<uint64_t>(),
                  .floor_fraction = json.at("learning_rate_floor").get<double>(),
                  .budget = {.iterations = json.at("budget").at("iterations").get<uint64_t>(),
                             .seconds = json.at("budget").at("seconds").get<double>()}};
    s.optimiser =
        parse(json.value("optimiser", std::string("adamw")), kOptimisers, where + ": optimiser");
    const nlohmann::json& adamw = json.at("adamw");
    s.beta1 = adamw.at("beta1").get<double>();
    s.beta2 = adamw.at("beta2").get<double>();
    s.epsilon = adamw.at("epsilon").get<double>();
    s.weight_decay = adamw.at("weight_decay").get<double>();
    const std::string precision = json.at("precision").get<std::string>();
    require(precision == "bf16" || precision == "f32", where, "precision: is neither f32 nor bf16");
    s.bf16 = precision == "bf16";
    s.threads = json.at("threads").get<uint32_t>();
    s.views_per_pose = json.value("views_per_pose", 1u);
    s.poses_per_iteration = json.value("poses_per_iteration", 1u);
    read_loss(json.at("loss"), s);
    s.standoff_weight = json.value("standoff_weight", 0.0f);
    s.background =
        parse(json.at("background").get<std::string>(), kBackgrounds, where + ": background");
    s.warmup_iterations = json.at("warmup_iterations").get<uint32_t>();
    s.crop_margin_px = json.at("crop_margin_px").get<uint32_t>();
    s.whole_image_period = json.at("whole_image_period").get<uint32_t>();
    read_parts(json, where, s);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(where + ": settings: " + error.what());
  }
  find_preset(s.preset);
  check_parts(s, where);
  require(s.fourier_octaves <= 10, where, "fourier_octaves: more than 10");
  require(s.decoding.sh_degree <= kMaxShDegree, where, "decoding.sh_degree: more than 3");
  for (float value :
       {s.decoding.offset_scale_m, s.decoding.spacing_scale, s.decoding.max_log_scale}) {
    require(std::isfinite(value) && value > 0, where,
            "decoding: scales must be positive and finite");
  }
  require(s.decoding.max_offset >= 0 && s.decoding.max_offset <= 1000, where,
          "decoding.max_offset: must be 0 to 1000");
  require(s.decoding.max_offset == 0 || s.standoff_weight == 0, where,
          "decoding.max_offset: not together with stand-off, which knows of no bound");
  require(s.schedule.peak > 0 && std::isfinite(s.schedule.peak), where,
          "learning_rate: must be positive and finite");
  require(s.standoff_weight >= 0 && std::isfinite(s.standoff_weight), where,
          "standoff_weight: must be finite and not negative");
  require((s.schedule.budget.iterations > 0) != (s.schedule.budget.seconds > 0), where,
          "budget: iterations or seconds, one of both");
  require(s.views_per_pose >= 1 && s.views_per_pose <= 64, where,
          "views_per_pose: must be 1 to 64");
  require(s.poses_per_iteration >= 1 && s.poses_per_iteration <= 64, where,
          "poses_per_iteration: must be 1 to 64");
  require(s.threads >= 1 && s.threads <= 256, where, "threads: must be 1 to 256");
  return s;
}

}  // namespace figurine::train
