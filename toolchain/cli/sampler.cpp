// figurine-train sampler: the diffusion model over a population's weights.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>

#include "ports/command_line/values.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/precision.h"
#include "toolchain/cli/threads.h"
#include "toolchain/generate/sampler_trainer.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

struct SamplerArguments {
  generate::SamplerRequest request;
  std::string variant = "basis", size = "device", prediction = "clean", precision = "f32";
  std::optional<int64_t> d_model, blocks, heads, feed_forward;
  std::optional<double> minutes;
  std::optional<uint64_t> iterations;
};

void run(SamplerArguments arguments) {
  generate::SamplerRequest& request = arguments.request;
  generate::SamplerSettings& settings = request.settings;
  const generate::TransformerPreset& size = generate::find_transformer_preset(arguments.size);
  settings.space.variant = generate::variant_from_string(arguments.variant);
  settings.shape.prediction = generate::prediction_from_string(arguments.prediction);
  settings.shape.d_model = arguments.d_model.value_or(size.d_model);
  settings.shape.blocks = arguments.blocks.value_or(size.blocks);
  settings.shape.heads = arguments.heads.value_or(size.heads);
  settings.shape.feed_forward = arguments.feed_forward.value_or(size.feed_forward);
  settings.bf16 = asks_for_bf16(arguments.precision);
  if (arguments.iterations)
    settings.schedule.budget = {.iterations = *arguments.iterations, .seconds = 0};
  if (arguments.minutes)
    settings.schedule.budget = {.iterations = 0, .seconds = 60 * *arguments.minutes};
  request.command = train::current_command();
  request.place = generate::rank_place_from_environment();
  const generate::SamplerResult result = generate::train_sampler(request);
  if (request.quiet || request.place.rank > 0) return;
  char validation[48] = "";
  if (std::isfinite(result.validation_loss)) {
    std::snprintf(validation, sizeof(validation), ", validation %.5f", result.validation_loss);
  }
  ports::sayf("%s: %s%llu iterations in %.0f s, loss %.5f%s", request.run.c_str(),
              result.was_finished ? "was finished: " : "",
              static_cast<unsigned long long>(result.iteration), result.seconds, result.loss,
              validation);
}

}  // namespace

void add_sampler_command(CLI::App& app) {
  auto arguments = std::make_shared<SamplerArguments>();
  generate::SamplerRequest& request = arguments->request;
  generate::SamplerSettings& settings = request.settings;
  settings.threads = 0;
  CLI::App* command = app.add_subcommand(
      "sampler", "Train the diffusion model that samples the weights of new avatars");
  command
      ->add_option("--population", request.population,
                   "Package to learn from: its training part alone")
      ->required();
  command->add_option("--body", request.body,
                      "Package that the population stands on: needed where members have static "
                      "parts");
  command->add_option("-o,--output", request.run, "Folder of the run")->required();
  command
      ->add_option("--variant", arguments->variant,
                   "What a token is (default basis: principal directions of a layer)")
      ->check(ports::one_of({"layer", "flat", "latent", "basis"}));
  command
      ->add_option("--size", arguments->size,
                   "Of the transformer (default device; paper: d_model 512, feed-forward 2048)")
      ->check(ports::one_of({"small", "device", "paper"}));
  command
      ->add_option("--d-model", arguments->d_model,
                   "Width of a token; a multiple of twice the heads")
      ->check(ports::between(1, 1 << 14));
  command->add_option("--blocks", arguments->blocks, "Transformer blocks")
      ->check(ports::between(1, 256));
  command->add_option("--heads", arguments->heads, "Attention heads")
      ->check(ports::between(1, 256));
  command->add_option("--feed-forward", arguments->feed_forward, "Width of the feed-forward layers")
      ->check(ports::between(1, 1 << 16));
  command
      ->add_option("--rank", settings.space.rank,
                   "Variant basis: most directions of a token (default 64)")
      ->check(ports::between(1, 1024));
  command
      ->add_option("--chunk", settings.space.chunk,
                   "Variant flat: values of a token (default 4096)")
      ->check(ports::between(1, 1 << 20));
  command
      ->add_option("--latent-channels", settings.autoencoder.channels,
                   "Variant latent: of the map that the autoencoder makes (default 4)")
      ->check(ports::between(1, 256));
  command
      ->add_option(
          "--autoencoder-iterations", settings.autoencoder.schedule.budget.iterations,
          "Variant latent: budget of the autoencoder, which is trained first (default 4000)")
      ->check(ports::positive());
  command
      ->add_option("--kl-weight", settings.autoencoder.kl_weight,
                   "Variant latent: weight of the KL divergence (default 1e-3)")
      ->check(ports::between(0.0, 1e3));
  command
      ->add_option("--members", settings.members,
                   "Learn from the first so many training members (default all)")
      ->check(ports::between(2u, kMaxMembers));
  command
      ->add_option("--pieces", settings.pieces,
                   "Tokens of a static part's grid, about: a part of the body is one token, or "
                   "several of a piece each (default 1)")
      ->check(ports::between(1, 1024));
  command
      ->add_option("--mixed", settings.mixed_share,
                   "Share of a batch that is mixed by part: head, upper and lower body of three "
                   "members (default 0; needs static parts and --body)")
      ->check(ports::between(0.0, 1.0));
  command->add_option("--batch", settings.batch, "Members an iteration (default 32)")
      ->check(ports::between(1, 65536));
  command
      ->add_option("--learning-rate", settings.schedule.peak,
                   "Of AdamW, at its highest (default 2e-4)")
      ->check(ports::between(1e-9, 1.0));
  command
      ->add_option("--prediction", arguments->prediction,
                   "What the transformer says: clean values, or velocity (flow matching; has no "
                   "package)")
      ->check(ports::one_of({"clean", "velocity"}));
  command
      ->add_option("--dropout", settings.dropout,
                   "Share that the transformer's blocks leave out in training (default 0)")
      ->check(ports::between(0.0, 0.95));
  command->add_option("--weight-decay", settings.weight_decay, "Of AdamW (default 0)")
      ->check(ports::between(0.0, 10.0));
  command
      ->add_option("--ema", settings.ema,
                   "Decay of the moving average of the weights (default 0.999)")
      ->check(ports::between(0.0, 0.999999));
  command
      ->add_option("--clean-snr", settings.clean_snr,
                   "Signal-to-noise ratio where sampling ends (default 1e4)")
      ->check(ports::between(1.0, 1e12));
  command
      ->add_option("--noisy-end", settings.noisy_dimension_snr,
                   "Dimension times signal-to-noise ratio where sampling begins (default 0.1)")
      ->check(ports::between(1e-9, 100.0));
  command->add_option("--seed", settings.seed, "Of weights, order and noise (default 1)");
  add_precision_option(*command, arguments->precision,
                       "Of matrix products (default f32; auto: bf16 where the CPU has it)");
  add_threads_option(*command, settings.threads,
                     "Default: all cores; with --resume as many as the run began with");
  CLI::Option* iterations =
      command->add_option("--iterations", arguments->iterations, "Budget (default 10000)")
          ->check(ports::positive());
  command->add_option("--minutes", arguments->minutes, "Budget in minutes of training")
      ->check(ports::positive())
      ->excludes(iterations);
  command
      ->add_option(
          "--rank-timeout", request.rank_timeout_s,
          "Seconds that ranks wait for each other at most, under srun or WORLD_SIZE (default 600)")
      ->check(ports::between(1.0, 1e6));
  command->add_flag("--resume", request.resume,
                    "Go on from the run's checkpoint, by the run's own settings");
  command
      ->add_option("--checkpoint-seconds", request.checkpoint_period_s,
                   "Between two checkpoints (default 60), or 20 times what one takes")
      ->check(ports::not_negative());
  command->add_flag("--quiet", request.quiet, "No progress, no summary");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace figurine::cli
