#include "toolchain/generate/flat_trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/flat_tensor.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"

namespace figurine::generate {

namespace {

constexpr uint64_t kLogPeriod = 50;
constexpr uint64_t kValidationPeriod = 500;  // iterations; a multiple of the log's
constexpr double kRunningMean = 0.02;
constexpr double kCheckpointShare = 0.05;  // of the time: `layer` at edge saves 1.4 GB, which takes
                                           // some disks longer than the period

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Share share_of(int64_t batch, int rank, int ranks) {
  const int64_t first = batch * rank / ranks;
  return {first, batch * (rank + 1) / ranks - first};
}

void check_batch(uint32_t batch, const ProcessGroup& group, const std::string& run) {
  if (static_cast<int64_t>(batch) >= group.size()) return;
  throw InputError(run + ": a batch of " + std::to_string(batch) + " is too small for " +
                   std::to_string(group.size()) + " ranks");
}

nlohmann::json log_to_json(const std::vector<FlatLogRow>& log) {
  nlohmann::json json = nlohmann::json::array();
  for (const FlatLogRow& row : log) {
    const nlohmann::json validation =
        std::isfinite(row.validation_loss) ? nlohmann::json(row.validation_loss) : nlohmann::json();
    json.push_back({row.iteration, row.seconds, row.learning_rate, row.loss, validation});
  }
  return json;
}

std::vector<FlatLogRow> log_from_json(const nlohmann::json& json, uint64_t last_iteration) {
  std::vector<FlatLogRow> log;
  for (const nlohmann::json& row : json) {
    if (row.at(0).get<uint64_t>() > last_iteration) break;
    log.push_back(
        {row.at(0).get<uint64_t>(), row.at(1).get<double>(), row.at(2).get<double>(),
         row.at(3).get<double>(),
         row.at(4).is_null() ? std::numeric_limits<double>::quiet_NaN() : row.at(4).get<double>()});
  }
  return log;
}

void save_log(const std::string& path, const std::vector<FlatLogRow>& log) {
  std::string text = "iteration,seconds,learning_rate,loss,validation_loss\n";
  for (const FlatLogRow& row : log) {
    char line[160];
    std::snprintf(line, sizeof(line), "%llu,%.3f,%.6g,%.6f,",
                  static_cast<unsigned long long>(row.iteration), row.seconds, row.learning_rate,
                  row.loss);
    text += line;
    if (std::isfinite(row.validation_loss))
      std::snprintf(line, sizeof(line), "%.6f", row.validation_loss), text += line;
    text += "\n";
  }
  throw_if_error(ports::write_file_atomically(path, std::as_bytes(std::span(text))), "cannot save");
}

FlatTrainer::FlatTrainer(FlatModel& model, ProcessGroup& group, FlatTraining options, Saved saved)
    : model_(model),
      group_(group),
      options_(std::move(options)),
      saved_(std::move(saved)),
      share_(share_of(options_.batch, group.rank(), group.size())),
      average_(model.weights().clone()),
      optimiser_(model::adamw_group(static_cast<uint64_t>(model.weights().numel())),
                 {.beta1 = options_.beta1,
                  .beta2 = options_.beta2,
                  .epsilon = 1e-8,
                  .weight_decay = options_.weight_decay}) {
  check_batch(options_.batch, group, options_.run);
}

void FlatTrainer::resume(const nlohmann::json& log) {
  const std::string& path = options_.checkpoint;
  if (!group_.leads() || !std::filesystem::exists(path)) return;
  const train::TensorFile file = train::read_checkpoint_file(path);
  if (const auto found = file.metadata.find("settings");
      found == file.metadata.end() || found->second != options_.settings_hash) {
    throw InputError(options_.run + "/run.json: settings: are not those of " + path);
  }
  train::take_flat_tensor(file, path, "weights", model_.weights());
  train::take_flat_tensor(file, path, "average", average_);
  train::take_flat_tensor(file, path, "first_moment", optimiser_.first_moment);
  train::take_flat_tensor(file, path, "second_moment", optimiser_.second_moment);
  progress_.iteration = static_cast<uint64_t>(train::take_number(file, path, "iteration"));
  progress_.seconds = train::take_number(file, path, "seconds");
  optimiser_.steps = static_cast<int64_t>(train::take_number(file, path, "optimiser_steps"));
  progress_.log = log_from_json(log, progress_.iteration);
}

// All ranks begin where rank 0 is.
void FlatTrainer::share_state() {
  for (torch::Tensor* tensor :
       {&model_.weights(), &average_, &optimiser_.first_moment, &optimiser_.second_moment})
    group_.broadcast(*tensor);
  torch::Tensor numbers = torch::tensor({static_cast<double>(progress_.iteration),
                                         progress_.seconds, static_cast<double>(optimiser_.steps)},
                                        torch::kFloat64);
  group_.broadcast(numbers);
  progress_.iteration = static_cast<uint64_t>(numbers[0].item<double>()),
  progress_.seconds = numbers[1].item<double>();
  optimiser_.steps = static_cast<int64_t>(numbers[2].item<double>());
}

FlatProgress FlatTrainer::run() {
  share_state();
  try {
    train_to_the_end();
  } catch (const PeerLost& lost) {
    if (!group_.leads()) throw;
    save("interrupted");
    throw PeerLost(std::string(lost.what()) + "; saved after " +
                   std::to_string(progress_.iteration) +
                   " iterations, --resume goes on from there");
  }
  if (group_.leads()) progress_.validation_loss = validate();
  save("finished");
  return progress_;
}

void FlatTrainer::train_to_the_end() {
  train::Progress bar(options_.title, options_.quiet || !group_.leads());
  train::InterruptGuard interrupt;
  double next_checkpoint = now_s() + options_.checkpoint_period_s;
  const double session_start = progress_.seconds;
  const uint64_t session_first = progress_.iteration;
  const train::Budget& budget = options_.schedule.budget;
  uint64_t& iteration = progress_.iteration;
  double& seconds = progress_.seconds;
  double done = train::progress(budget, iteration, seconds);
  bool stop = false;
  while (done < 1) {
    if (stop || (options_.stop_after > 0 && iteration >= options_.stop_after)) {
      save("interrupted");
      group_.barrier();  // a rank that leaves may end the others: not before rank 0 has saved
      if (group_.size() > 1 && !interrupt.requested()) interrupt.ignore_late();
      throw train::Interrupted(options_.run + ": stopped after " + std::to_string(iteration) +
                               " iterations; --resume goes on from here");
    }
    const double rate = train::learning_rate(options_.schedule, iteration, seconds),
                 before = now_s();
    double loss = iterate(rate);
    seconds += now_s() - before;
    ++iteration;
    stop = agree(loss, interrupt.requested());
    record(loss, rate);
    done = train::progress(budget, iteration, seconds);
    const double speed =
        static_cast<double>(iteration - session_first) / std::max(1e-9, seconds - session_start);
    char line[160];
    std::snprintf(line, sizeof(line), "iteration %llu, loss %.5f, %.2f it/s",
                  static_cast<unsigned long long>(iteration), progress_.loss, speed);
    bar.show(done, line);
    if (now_s() > next_checkpoint && done < 1) {
      const double start = now_s();
      save("running");
      next_checkpoint =
          now_s() + std::max(options_.checkpoint_period_s, (now_s() - start) / kCheckpointShare);
    }
  }
}

// Returns this rank's part of the loss.
double FlatTrainer::iterate(double rate) {
  model_.gradients().zero_();
  torch::Tensor loss = model_.loss(progress_.iteration, share_);
  if (share_.count < static_cast<int64_t>(options_.batch))
    loss = loss * (static_cast<double>(share_.count) / options_.batch);
  const double value = loss.item<double>();
  if (group_.size() == 1 && !std::isfinite(value)) fail("the loss is not finite");
  loss.backward();
  group_.sum(model_.gradients());
  // Of many ranks all see the same sum here, so that all of them fail.
  if (!optimiser_.step(model_.weights(), model_.gradients(), rate))
    fail("a gradient is not finite");
  // The average of a young run forgets faster, or it would remember the random start.
  const double age = static_cast<double>(progress_.iteration + 1),
               decay = std::min(options_.ema, age / (age + 9));
  average_.lerp_(model_.weights(), 1 - decay);
  return value;
}

// What all ranks go on with: the batch's loss, rank 0's seconds, and whether any of them was asked
// to stop.
bool FlatTrainer::agree(double& loss, bool stop) {
  if (group_.size() == 1) return stop;
  torch::Tensor numbers = torch::tensor(
      {loss, stop ? 1.0 : 0.0, group_.leads() ? progress_.seconds : 0.0}, torch::kFloat64);
  group_.sum(numbers);
  loss = numbers[0].item<double>(), progress_.seconds = numbers[2].item<double>();
  return numbers[1].item<double>() > 0;
}

void FlatTrainer::fail(const std::string& what) const {
  throw InputError(options_.run + ": iteration " + std::to_string(progress_.iteration) + ": " +
                   what + "; the last checkpoint is kept");
}

// Loss of the moving average on the validation members.
double FlatTrainer::validate() {
  const torch::NoGradGuard no_gradient;
  const torch::Tensor own = model_.weights().clone();
  model_.weights().copy_(average_);
  const double loss = model_.validation_loss();
  model_.weights().copy_(own);
  return loss;
}

void FlatTrainer::record(double loss, double rate) {
  sum_ += loss, ++count_;
  const double weight = std::max(kRunningMean, 1.0 / static_cast<double>(++shown_count_));
  progress_.loss += weight * (loss - progress_.loss);
  if (progress_.iteration % kLogPeriod != 0) return;
  group_.expect_same(model_.weights(), "the weights");
  FlatLogRow row{.iteration = progress_.iteration,
                 .seconds = progress_.seconds,
                 .learning_rate = rate,
                 .loss = sum_ / static_cast<double>(count_)};
  if (group_.leads() && progress_.iteration % kValidationPeriod == 0)
    row.validation_loss = progress_.validation_loss = validate();
  progress_.log.push_back(row);
  sum_ = 0, count_ = 0;
}

void FlatTrainer::save(const char* status) {
  if (!group_.leads()) return;
  train::TensorFile file;
  file.tensors["weights"] = train::flat_tensor(model_.weights());
  file.tensors["average"] = train::flat_tensor(average_);
  file.tensors["first_moment"] = train::flat_tensor(optimiser_.first_moment);
  file.tensors["second_moment"] = train::flat_tensor(optimiser_.second_moment);
  file.metadata["iteration"] = train::exact_number(static_cast<double>(progress_.iteration));
  file.metadata["seconds"] = train::exact_number(progress_.seconds);
  file.metadata["optimiser_steps"] = train::exact_number(static_cast<double>(optimiser_.steps));
  file.metadata["settings"] = options_.settings_hash;
  train::write_tensor_file(options_.checkpoint, file);
  saved_(status, progress_);
}

}  // namespace figurine::generate
