// The training of one network whose parameters are one flat tensor: AdamW under a schedule, a
// moving average of the weights, a log, checkpoints from which a run goes on with the same bits,
// Ctrl-C, and ranks that share every batch.
//
// With R ranks, rank r computes places [r B / R, (r + 1) B / R) of every batch of B; its mean loss
// is weighted by its share of the batch, so that the sum over the ranks is the mean over the batch.
// One all-reduce adds the flat gradients, a second one of three numbers the loss, the wish to stop
// and rank 0's seconds, by which all decide alike. Rank 0 alone validates, writes and shows
// progress.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/generate/process_group.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/tensor.h"
#include "toolchain/train/schedule.h"

namespace figurine::generate {

// The places of a batch that a rank computes.
struct Share {
  int64_t first = 0, count = 0;
};
Share share_of(int64_t batch, int rank, int ranks);
// Throws InputError if a rank would have nothing to do.
void check_batch(uint32_t batch, const ProcessGroup& group, const std::string& run);

// What is trained. What it draws is a function of the iteration and the place in the batch.
class FlatModel {
 public:
  virtual ~FlatModel() = default;
  virtual torch::Tensor& weights() = 0;    // [P] flat; assigned to in place only
  virtual torch::Tensor& gradients() = 0;  // [P] flat; backward passes add to it
  virtual torch::Tensor loss(uint64_t iteration,
                             Share share) = 0;  // mean over the share, differentiable
  virtual double
  validation_loss() = 0;  // of the weights as they are; NaN if there is nothing to validate on
};

struct FlatTraining {
  std::string title;          // of the progress bar
  std::string run;            // as messages name it
  std::string checkpoint;     // file
  std::string settings_hash;  // of what the checkpoint must have been trained with
  uint32_t batch = 32;
  train::Schedule schedule;
  double beta1 = 0.9, beta2 = 0.999, weight_decay = 0;
  double ema = 0.999;               // decay of the moving average
  double checkpoint_period_s = 60;  // or 20 times what the last one took, if that is longer
  uint64_t stop_after = 0;          // interrupt before this iteration, as Ctrl-C would; 0: never
  bool quiet = false;
};

struct FlatLogRow {
  uint64_t iteration = 0;
  double seconds = 0, learning_rate = 0, loss = 0,
         validation_loss = std::numeric_limits<double>::quiet_NaN();
};

// How far a training is.
struct FlatProgress {
  uint64_t iteration = 0;
  double seconds = 0;
  double loss = 0;  // mean over the last iterations
  double validation_loss = std::numeric_limits<double>::quiet_NaN();
  std::vector<FlatLogRow> log;
};

nlohmann::json log_to_json(const std::vector<FlatLogRow>& log);
std::vector<FlatLogRow> log_from_json(const nlohmann::json& json, uint64_t last_iteration);
// Throws InputError if the disk refuses.
void save_log(const std::string& path, const std::vector<FlatLogRow>& log);

class FlatTrainer {
 public:
  // Called on rank 0 whenever a checkpoint was written: "running", "interrupted", "finished".
  using Saved = std::function<void(const char* status, const FlatProgress& progress)>;

  // model and group are borrowed.
  FlatTrainer(FlatModel& model, ProcessGroup& group, FlatTraining options, Saved saved);

  // Goes on from the checkpoint, if rank 0 has one. log: of the run so far. Throws InputError
  // naming what does not fit.
  void resume(const nlohmann::json& log);
  // Throws InputError, PeerLost (rank 0 has saved) or train::Interrupted (rank 0 has saved).
  FlatProgress run();

  const torch::Tensor& average() const { return average_; }  // [P]: what is kept

 private:
  [[noreturn]] void fail(const std::string& what) const;
  void share_state();
  void train_to_the_end();
  double iterate(double rate);
  bool agree(double& loss, bool stop);
  void record(double loss, double rate);
  double validate();
  void save(const char* status);

  FlatModel& model_;
  ProcessGroup& group_;
  FlatTraining options_;
  Saved saved_;
  Share share_;
  torch::Tensor average_;
  model::Optimiser optimiser_;
  FlatProgress progress_;
  double sum_ = 0;  // of losses since the last row
  uint64_t count_ = 0, shown_count_ = 0;
};

}  // namespace figurine::generate
