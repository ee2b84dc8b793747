// The paper's second stage: a denoiser over the weights of a population's training members.
//
// Every iteration draws a batch of members, a noise level for each (stratified over the schedule,
// so that a batch sees all of it) and standard normal noise: z = alpha x + sigma eps; the loss is
// the mean square of what is predicted less x (the paper's MSE on clean weights). The moving
// average of the weights is what is kept. Everything that is drawn is a function of (seed,
// iteration, place in the batch), so a resumed run draws what an uninterrupted one draws, and ranks
// of a cluster share a batch without a word (flat_trainer.h).
//
//   RUN/run.json                 command, settings, population (its content hash), machine; when
//                                done also iterations, seconds, and
//                                seconds_per_evaluation of one vector
//   RUN/log.csv                  iteration, seconds, learning rate, loss, loss of the validation
//                                members (empty if there are none)
//   RUN/weights.safetensors      the denoiser, moving average: one tensor a parameter
//   RUN/checkpoint.safetensors   what --resume needs
//   RUN/autoencoder.safetensors, autoencoder_checkpoint.safetensors, autoencoder_log.csv   of
//       variant `latent`: the same, of what is
//                                trained first; its validation loss is the mean square error of a
//                                    standardised value
//
// Based on: the paper, section 4.2; Ho et al., DDPM, 2020; Song et al., Score-based models, 2021
// (the moving average).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "toolchain/generate/process_group.h"
#include "toolchain/generate/sampler_settings.h"
#include "toolchain/train/package_file.h"

namespace figurine::generate {

struct SamplerRequest {
  std::string population;  // package
  std::string body;        // package that it stands on; needed where members have static parts,
                           // whose patches are the body's
  std::string run;         // folder to write
  SamplerSettings settings;
  std::string command;  // as typed, for run.json
  // settings.threads: 0 for all cores, or as many as a resumed run began with. Two threads are many
  // times slower than one where another process wants the second core, so that going on must not
  // take more of them unasked.
  bool resume = false;  // goes on by the run's own settings; only settings.threads counts
  bool quiet = false;
  double checkpoint_period_s = 60;
  uint64_t stop_after = 0;  // interrupt before this iteration, as Ctrl-C would; 0: never (tests)
  RankPlace place;  // of many ranks all ask for the same, but for the run's folder and the threads:
                    // rank 0's run counts
  double rank_timeout_s = 600;
};

struct SamplerResult {
  uint64_t iteration = 0;
  double seconds = 0;
  double loss = 0;             // mean over the last iterations
  double validation_loss = 0;  // of the moving average; NaN without validation members
  bool was_finished = false;
  uint64_t weights_hash =
      0;  // of the denoiser's own weights, not their average: the same on every rank
};

// Throws InputError, PeerLost (state saved, if there was any) or train::Interrupted (state saved).
SamplerResult train_sampler(const SamplerRequest& request);

// The rows of a population's weights that belong to one part, in its order: [M,W]. At most `most`
// of them, 0: all.
measure::RowMatrix rows_of(const Population& population, const measure::RowMatrix& weights,
                           Split split, uint32_t most = 0);

// Whether a folder holds a run of a sampler, rather than of an avatar or nothing.
bool is_sampler_run(const std::string& path);

// A trained sampler: its space is built again from the population, whose hash must be the run's.
struct TrainedSampler {
  std::unique_ptr<train::PackageFile> population;
  SamplerSettings settings;
  std::unique_ptr<measure::WeightLayout> layout;
  std::unique_ptr<ModelSpace> space;
  measure::RowMatrix training;  // [N,D] model vectors
  std::unique_ptr<Transformer> transformer;

  // population, body: where they are now; empty: where the run found them.
  static TrainedSampler open(const std::string& run, const std::string& population = {},
                             const std::string& body = {});
};

}  // namespace figurine::generate
