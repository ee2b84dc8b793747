// figurine-train avatar: trains one person's UNet, or every person's of a folder.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "figurine/gaussian.h"
#include "ports/command_line/values.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/precision.h"
#include "toolchain/cli/threads.h"
#include "toolchain/cli/train_all.h"
#include "toolchain/error.h"
#include "toolchain/features/feature_network.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/trainer.h"

namespace figurine::cli {

namespace {

namespace fs = std::filesystem;

constexpr uint32_t kDefaultOctaves = 5;

// As typed; what was not given comes from the preset, or from the run that is resumed.
struct AvatarArguments {
  std::vector<std::string> data;  // of everybody who is to share a network
  std::string body, run;
  bool all = false, resume = false, quiet = false;
  std::optional<std::string> preset, init, template_mode, fourier, precision, background, optimiser,
      standoff, network, static_grids, static_colour, smallest_extent, antialiased, perceptual,
      adapter, basis;
  std::optional<uint64_t> seed, iterations;
  std::optional<double> minutes, learning_rate, weight_decay, static_learning_rate, static_penalty,
      clip_gradient;
  std::optional<float> spacing_scale, perceptual_weight;
  std::optional<uint32_t> warmup, views, poses, uv, network_size, channels, sh_degree,
      perceptual_window;
  std::optional<uint32_t> network_rank;
  bool freeze_pose = false, freeze_network = false;
  double checkpoint_s = train::TrainRequest{}.checkpoint_period_s;
  uint32_t threads = 0;  // 0: all cores, with --all one
  uint32_t slots = 0;    // 0: as many as the threads leave cores for
};

template <class Enum>
Enum choose(const std::string& text, std::initializer_list<Enum> values) {
  for (Enum value : values) {
    if (text == train::to_string(value)) return value;
  }
  throw InputError("\"" + text + "\" is unknown");  // CLI11 has checked the words already
}

// Network and static values.
void overlay_parts(const AvatarArguments& arguments, train::TrainSettings& settings) {
  using model::StaticColour;
  const bool other_side = arguments.uv && *arguments.uv != train::texel_side(settings);
  if (arguments.uv) settings.uv_size = *arguments.uv;
  if (arguments.network) settings.network = *arguments.network != "none";
  if (arguments.network_size) {
    settings.network_size = *arguments.network_size;
  } else if (!settings.network) {
    settings.network_size = 0;
  } else if (other_side && settings.network_size > 0) {
    settings.network_size = settings.uv_size / train::find_preset(settings.preset).network_step;
  }
  if (arguments.channels) settings.channels = *arguments.channels;
  if (arguments.static_grids)
    settings.static_grids = train::parse_static_grids(*arguments.static_grids, "--static-grids");
  if (arguments.static_colour)
    settings.static_colour =
        choose(*arguments.static_colour, {StaticColour::kGain, StaticColour::kSum});
  if (arguments.static_learning_rate)
    settings.static_learning_rate = *arguments.static_learning_rate;
  if (arguments.static_penalty) settings.static_penalty = *arguments.static_penalty;
  if (arguments.clip_gradient) settings.clip_gradient = *arguments.clip_gradient;
  if (arguments.smallest_extent) settings.smallest_extent = *arguments.smallest_extent == "on";
  if (arguments.antialiased) settings.antialiased = *arguments.antialiased == "on";
  if (arguments.freeze_network || arguments.network_rank) settings.freeze_network = true;
  if (arguments.network_rank) settings.adapter.rank = *arguments.network_rank;
  if (arguments.adapter)
    settings.adapter.kind = choose(
        *arguments.adapter,
        {model::AdapterKind::kResidual, model::AdapterKind::kScale, model::AdapterKind::kBasis});
  if (arguments.basis) settings.adapter.basis = *arguments.basis;
}

void overlay_perceptual(const AvatarArguments& arguments, train::PerceptualSettings& settings) {
  if (arguments.perceptual && *arguments.perceptual == "none") settings = {};
  if (arguments.perceptual && *arguments.perceptual != "none")
    settings.file = *arguments.perceptual;
  if (arguments.perceptual_weight) settings.weight = *arguments.perceptual_weight;
  if (arguments.perceptual_window) settings.window_px = *arguments.perceptual_window;
}

// Opens the network that the settings name. A run goes on with the very file that it began with.
void open_perceptual(train::TrainRequest& request, const std::string& hash_of_run) {
  train::PerceptualSettings& settings = request.settings.perceptual;
  if (settings.file.empty()) return;
  const features::LossNetwork network = features::open_loss_network(settings.file);
  if (!hash_of_run.empty() && network.hash != hash_of_run) {
    throw InputError(settings.file + ": hash: is " + network.hash + ", " + request.run +
                     " was trained with " + hash_of_run);
  }
  request.perceptual = network.distance;
  settings.name = network.name, settings.hash = network.hash;
}

void overlay(const AvatarArguments& arguments, train::TrainSettings& settings) {
  using train::TrainingBackground;
  if (arguments.template_mode)
    settings.template_mode =
        *arguments.template_mode == "mean" ? TemplateMode::kMean : TemplateMode::kShaped;
  if (arguments.freeze_pose) settings.freeze_pose = true;
  if (arguments.fourier) {
    settings.fourier_octaves = *arguments.fourier == "off" ? 0
                               : *arguments.fourier == "on"
                                   ? kDefaultOctaves
                                   : uint32_t(std::stoul(*arguments.fourier));
  }
  overlay_parts(arguments, settings);
  overlay_perceptual(arguments, settings.perceptual);
  if (arguments.sh_degree) settings.decoding.sh_degree = *arguments.sh_degree;
  if (arguments.seed) settings.seed = *arguments.seed;
  if (arguments.init) settings.init = *arguments.init;
  if (arguments.learning_rate) settings.schedule.peak = *arguments.learning_rate;
  if (arguments.optimiser)
    settings.optimiser =
        choose(*arguments.optimiser, {train::OptimiserKind::kAdamW, train::OptimiserKind::kMuon});
  if (arguments.weight_decay) settings.weight_decay = *arguments.weight_decay;
  if (arguments.spacing_scale) settings.decoding.spacing_scale = *arguments.spacing_scale;
  if (arguments.warmup) settings.warmup_iterations = *arguments.warmup;
  if (arguments.views) settings.views_per_pose = *arguments.views;
  if (arguments.poses) settings.poses_per_iteration = *arguments.poses;
  if (arguments.iterations)
    settings.schedule.budget = {.iterations = *arguments.iterations, .seconds = 0};
  if (arguments.minutes)
    settings.schedule.budget = {.iterations = 0, .seconds = 60 * *arguments.minutes};
  if (arguments.precision) settings.bf16 = asks_for_bf16(*arguments.precision);
  if (arguments.standoff)
    settings.standoff_weight = *arguments.standoff == "on" ? train::TrainSettings{}.standoff_weight
                               : *arguments.standoff == "off" ? 0
                                                              : std::stof(*arguments.standoff);
  if (arguments.background) {
    settings.background = choose(
        *arguments.background,
        {TrainingBackground::kBlack, TrainingBackground::kGrey, TrainingBackground::kRandom});
  }
}

uint32_t core_count() { return model::default_threads(); }

// Two one-thread trainings on two cores do more than one of two threads after the other
// (docs/training.md).
uint32_t thread_count(const AvatarArguments& arguments) {
  return arguments.threads > 0 ? arguments.threads : arguments.all ? 1 : core_count();
}

uint32_t slot_count(const AvatarArguments& arguments) {
  return arguments.slots > 0 ? arguments.slots
                             : std::max(1u, core_count() / thread_count(arguments));
}

// Sums are in another order with another number of threads.
void say_threads(const std::string& run, uint32_t before, uint32_t now) {
  if (now == before) {
    ports::sayf("%s: goes on with %u threads, as it began", run.c_str(), now);
  } else {
    ports::sayf("%s: goes on with %u threads, began with %u: its end will differ in rounding",
                run.c_str(), now, before);
  }
}

// data: of one person, or of several who share a network.
train::TrainRequest make_request(const AvatarArguments& arguments,
                                 const std::vector<std::string>& data, const std::string& run) {
  train::TrainRequest request{.data = data.empty() ? "" : data.front(),
                              .more_data = {},
                              .body = arguments.body,
                              .run = run,
                              .settings = {},
                              .command = train::current_command(),
                              .resume = arguments.resume,
                              .quiet = arguments.quiet};
  request.checkpoint_period_s = arguments.checkpoint_s;
  if (data.size() > 1) request.more_data.assign(data.begin() + 1, data.end());
  if (arguments.resume && fs::exists(train::RunDirectory{run}.run_json())) {
    const train::RunDescription old = train::read_run({run});
    if (request.data.empty()) request.data = old.data, request.more_data = old.more_data;
    if (request.body.empty()) request.body = old.body;
    request.settings = old.settings;
    if (arguments.preset && *arguments.preset != old.settings.preset)
      throw InputError(run + ": --preset differs from the run that is resumed");
    overlay(arguments, request.settings);
    open_perceptual(request, old.settings.perceptual.hash);
    const nlohmann::json asked = train::to_json(request.settings),
                         was = train::to_json(old.settings);
    // What has its default may be left out of either.
    nlohmann::json all = asked;
    all.update(was);
    for (const auto& [key, value] : all.items()) {
      if (asked.value(key, nlohmann::json()) != was.value(key, nlohmann::json()))
        throw InputError(run + ": --resume goes on with the run's own settings; " + key +
                         " differs from run.json");
    }
    if (arguments.threads > 0) request.settings.threads = arguments.threads;
    if (!arguments.quiet && !arguments.all && old.json.value("status", "") != "finished")
      say_threads(run, old.settings.threads, request.settings.threads);
  } else {
    if (request.data.empty()) throw InputError("--data is needed for a new run");
    if (request.body.empty()) throw InputError("--body is needed for a new run");
    request.resume =
        arguments.resume && !arguments.all;  // with --all, what has not begun begins now
    request.settings = train::preset_settings(arguments.preset.value_or("edge"));
    request.settings.bf16 = train::has_fast_bf16();
    overlay(arguments, request.settings);
    open_perceptual(request, "");
    request.settings.threads = thread_count(arguments);
  }
  return request;
}

void train_one(const AvatarArguments& arguments) {
  const std::string& run = arguments.run;
  const train::TrainResult result =
      train::train_avatar(make_request(arguments, arguments.data, run));
  if (arguments.quiet) return;
  if (result.was_finished) {
    ports::sayf("%s: was finished already (%llu iterations)", run.c_str(),
                static_cast<unsigned long long>(result.state.iteration));
    return;
  }
  ports::sayf("%s: %llu iterations in %s (%.1f a second), training PSNR %.2f dB", run.c_str(),
              static_cast<unsigned long long>(result.state.iteration),
              train::format_duration(result.state.seconds).c_str(),
              static_cast<double>(result.state.iteration) / std::max(1e-9, result.state.seconds),
              result.psnr_db);
}

}  // namespace

void add_part_options(CLI::App* command, AvatarArguments& arguments) {
  command->add_option("--uv", arguments.uv, "Texels a side, as the body's (default: the preset's)")
      ->check(ports::between(8, 1024));
  command
      ->add_option("--network", arguments.network,
                   "none: static values alone, whatever the pose (default unet)")
      ->check(ports::one_of({"unet", "none"}));
  command
      ->add_option(
          "--network-size", arguments.network_size,
          "Texels a side that the network sees: 1, 1/2, 1/4 or 1/8 of the body's (default: "
          "the preset's share: edge 1/2, fine 1/4, others all)")
      ->check(ports::between(8, 1024));
  command->add_option("--channels", arguments.channels, "Of the network (default: the preset's)")
      ->check(ports::between(1, 2048));
  command->add_option(
      "--static-grids", arguments.static_grids,
      "What every texel owns whatever the pose, by groups of channels and their "
      "resolution: colour:T,rest:T/2 (all, colour, rest, geometry, offset, scale, "
      "rotation, opacity; T, T/2, T/4, T/8), or none (default: the preset's: edge all:T, "
      "fine colour:T,rest:T/2, others none)");
  command
      ->add_option("--static-colour", arguments.static_colour,
                   "Static colours times the network's (gain, default) or added to them (sum: an "
                   "experiment, cannot be packed)")
      ->check(ports::one_of({"gain", "sum"}));
  command
      ->add_option("--static-learning-rate", arguments.static_learning_rate,
                   "Of the static values, peak of the same schedule (default 1.5e-2)")
      ->check(ports::not_negative());
  command
      ->add_option("--static-penalty", arguments.static_penalty,
                   "Weight of the static values' mean square in the loss (default 0)")
      ->check(ports::not_negative());
  command->add_flag("--freeze-network", arguments.freeze_network,
                    "The network of --init stays: only the static values learn");
  CLI::Option* rank =
      command
          ->add_option("--network-rank", arguments.network_rank,
                       "The network of --init stays, but for an adapter of this rank on its "
                       "kernels, which learns beside the static values; packages hold the result")
          ->check(ports::between(1, 256));
  CLI::Option* adapter =
      command
          ->add_option("--network-adapter", arguments.adapter,
                       "residual: A B is added to a kernel (default); scale: the kernel is "
                       "multiplied by 1 + A B; basis: A alone is learned, B is --network-basis'")
          ->check(ports::one_of({"residual", "scale", "basis"}))
          ->needs(rank);
  command
      ->add_option("--network-basis", arguments.basis,
                   "Directions that many people share (figurine-train basis)")
      ->needs(adapter);
  command
      ->add_option("--clip-gradient", arguments.clip_gradient,
                   "Largest norm of an iteration's gradients; run.json says the last (default 0: "
                   "none)")
      ->check(ports::not_negative());
}

void add_filter_options(CLI::App* command, AvatarArguments& arguments) {
  command
      ->add_option("--smallest-extent", arguments.smallest_extent,
                   "on: no Gaussian below what the sharpest training view of its texel resolved, "
                   "for close-ups (default: the preset's)")
      ->check(ports::one_of({"on", "off"}));
  command
      ->add_option("--antialiased", arguments.antialiased,
                   "on: what widens a small Gaussian to the pixel grid is taken from its opacity, "
                   "in training and on devices, for views from afar (default: the preset's)")
      ->check(ports::one_of({"on", "off"}));
}

void add_perceptual_options(CLI::App* command, AvatarArguments& arguments) {
  CLI::Option* network = command->add_option(
      "--perceptual", arguments.perceptual,
      "Network of a perceptual loss: .safetensors of figurine-train features, AlexNet and LPIPS' "
      "weights as .npz or TorchScript (docs/features.md), or none (default)");
  command
      ->add_option("--perceptual-weight", arguments.perceptual_weight,
                   "Of the distance that it sees, beside 1 for L1 (default 0.01, the paper's)")
      ->check(ports::not_negative())
      ->needs(network);
  command
      ->add_option("--perceptual-window", arguments.perceptual_window,
                   "Side in pixels of what it looks at in every picture, at a random place on the "
                   "person; 0: all of it (default 128)")
      ->check(ports::between(0, 4096))
      ->needs(network);
}

void add_avatar_command(CLI::App& app) {
  auto arguments = std::make_shared<AvatarArguments>();
  CLI::App* command = app.add_subcommand("avatar", "Train one person's avatar from a capture");
  command
      ->add_option("--data", arguments->data,
                   "Folder of one identity (with --all: of identities). Given several times: one "
                   "network for all of them, static values for each, whose runs are folders in the "
                   "run's")
      ->allow_extra_args(false);
  command->add_option("--body", arguments->body, "Body package (figurine-train body)");
  command->add_option("-o,--output", arguments->run, "Folder of the run (with --all: of runs)")
      ->required();
  command->add_flag("--all", arguments->all,
                    "Every identity of the folder; one that fails does not stop the others");
  command->add_flag("--resume", arguments->resume,
                    "Go on from the last checkpoint, by the run's own settings");
  command
      ->add_option("--checkpoint-seconds", arguments->checkpoint_s,
                   "Between two checkpoints (default 30)")
      ->check(ports::not_negative());
  command->add_flag("--quiet", arguments->quiet, "No progress, no summary");
  command->add_option("--preset", arguments->preset, "Size of the network (default edge)")
      ->check(ports::one_of({"nano", "edge", "fine", "paper"}));
  command->add_option("--init", arguments->init,
                      "Start from these weights (file or run) instead of the common initial ones");
  command->add_option("--seed", arguments->seed, "Of the order of the images (default 1)");
  CLI::Option* minutes =
      command
          ->add_option("--minutes", arguments->minutes,
                       "Train for so long (default 10); the learning rate follows the clock")
          ->check(ports::positive());
  command->add_option("--iterations", arguments->iterations, "Train for so many iterations instead")
      ->check(ports::positive())
      ->excludes(minutes);
  command
      ->add_option("--template", arguments->template_mode,
                   "Gaussians sit on the person's own shape (default) or on the mean template")
      ->check(ports::one_of({"shaped", "mean"}));
  command->add_flag("--freeze-pose", arguments->freeze_pose,
                    "Experiment: the network sees the rest pose in the true root orientation");
  command
      ->add_option("--fourier", arguments->fourier,
                   "Octaves of constant Fourier channels in the input, 1 to 10, or on (5) or off "
                   "(default: the preset's)")
      ->check(ports::one_of_or_whole_number({"on", "off"}, 1, 10));
  command
      ->add_option("--sh-degree", arguments->sh_degree,
                   "Of the colours' spherical harmonics (default: the preset's)")
      ->check(ports::between(uint32_t{0}, kMaxShDegree));
  command
      ->add_option("--learning-rate", arguments->learning_rate,
                   "Peak of the schedule (default 2e-3)")
      ->check(ports::positive());
  command
      ->add_option("--optimiser", arguments->optimiser,
                   "muon (default): Muon for the kernels of hidden convolutions, AdamW for the "
                   "rest; adamw: AdamW for all, as in the paper")
      ->check(ports::one_of({"adamw", "muon"}));
  command->add_option("--weight-decay", arguments->weight_decay, "The optimiser's (default 0)")
      ->check(ports::not_negative());
  add_precision_option(*command, arguments->precision,
                       "Of the convolutions (default auto: bf16 where the CPU has it)");
  command
      ->add_option("--background", arguments->background,
                   "Behind prediction and truth in the loss (default grey)")
      ->check(ports::one_of({"black", "grey", "random"}));
  command
      ->add_option("--standoff", arguments->standoff,
                   "Draw Gaussians to hair, skirts and shoes that stand off the skin: on "
                   "(default), off, or a weight")
      ->check(ports::one_of_or_number({"on", "off"}, 0, 1000));
  command
      ->add_option("--views-per-pose", arguments->views,
                   "Images of one pose an iteration (default 1, as in the paper)")
      ->check(ports::between(1, 64));
  command
      ->add_option("--poses", arguments->poses,
                   "Poses an iteration, side by side on threads of their own (default 1)")
      ->check(ports::between(1, 64));
  command
      ->add_option("--spacing-scale", arguments->spacing_scale,
                   "First radius of a Gaussian, in distances to the next texel (default 0.45)")
      ->check(ports::between(0.05, 5.0));
  command->add_option("--warmup", arguments->warmup,
                      "Iterations of fitting reference Gaussians first (default 0)");
  add_threads_option(*command, arguments->threads,
                     "Of a training (default: usable CPUs, at most 16; with --all: 1; with "
                     "--resume: as many as the run began with)");
  command
      ->add_option(
          "--slots", arguments->slots,
          "With --all: trainings at a time, each in its own process (default: cores / threads)")
      ->check(ports::between(1, 256));
  add_part_options(command, *arguments);
  add_filter_options(command, *arguments);
  add_perceptual_options(command, *arguments);
  command->callback([arguments] {
    if (arguments->all) {
      if (arguments->data.size() != 1) throw InputError("--all needs one --data");
      const std::string& folder = arguments->data.front();
      const auto request_of = [&](const std::string& identity) {
        return make_request(*arguments, {folder + "/" + identity}, arguments->run + "/" + identity);
      };
      train_all({.data = folder,
                 .runs = arguments->run,
                 .slots = slot_count(*arguments),
                 .quiet = arguments->quiet},
                request_of);
    } else {
      train_one(*arguments);
    }
  });
}

}  // namespace figurine::cli
