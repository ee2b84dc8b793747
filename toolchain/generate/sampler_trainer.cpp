#include "toolchain/generate/sampler_trainer.h"

#include <ATen/Parallel.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "figurine/noise_level.h"
#include "ports/linux/files.h"
#include "toolchain/error.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/random.h"
#include "toolchain/train/run_directory.h"

namespace figurine::generate {

using evaluate::RowMatrix;

namespace {

constexpr int kSamplerFormat = 1;
constexpr uint64_t kLogPeriod = 50;
constexpr uint64_t kValidationPeriod = 500;  // iterations; a multiple of the log's
constexpr int64_t kValidationDraws = 16;     // noise levels for each validation member, always the same ones
constexpr double kRunningMean = 0.02;
enum Stream : uint64_t { kLevels = 1, kNoise = 2, kValidationNoise = 3 };

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

torch::Tensor to_tensor(const RowMatrix& rows) {
  const torch::Tensor out = torch::empty({rows.rows(), rows.cols()});
  float* data = out.data_ptr<float>();
  for (Eigen::Index i = 0; i < rows.size(); ++i) data[i] = static_cast<float>(rows.data()[i]);
  return out;
}

// [D] standard normal of one draw.
torch::Tensor draw_noise(uint64_t seed, Stream stream, uint64_t counter, int64_t size) {
  auto generator = at::make_generator<at::CPUGeneratorImpl>(train::random_bits(seed, stream, counter));
  return torch::randn({size}, generator);
}

struct NoisyBatch {
  torch::Tensor z, lambda, clean;  // [B,D], [B], [B,D]
};

// One row of a batch: member x at the schedule's place u.
void add_noisy(NoisyBatch& batch, int64_t row, const torch::Tensor& x, const torch::Tensor& noise, const NoiseLevel& level) {
  batch.clean[row].copy_(x);
  batch.z[row].copy_(x * level.alpha + noise * level.sigma);
  batch.lambda[row] = level.lambda;
}

NoisyBatch empty_batch(int64_t rows, int64_t size) {
  return {torch::empty({rows, size}), torch::empty({rows}, torch::kFloat64), torch::empty({rows, size})};
}

std::string exact(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof(text), value);
  return {text, end.ptr};
}

struct LogRow {
  uint64_t iteration = 0;
  double seconds = 0, learning_rate = 0, loss = 0, validation_loss = std::numeric_limits<double>::quiet_NaN();
};

train::NamedTensor flat(const torch::Tensor& tensor) {
  const float* data = tensor.data_ptr<float>();
  return {{tensor.numel()}, {data, data + tensor.numel()}};
}

void take_flat(const std::string& path, const train::TensorFile& file, const std::string& name, torch::Tensor& tensor) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw InputError(path + ": " + name + ": missing");
  if (found->second.values.size() != static_cast<size_t>(tensor.numel())) throw InputError(path + ": " + name + ": is of another size");
  std::memcpy(tensor.data_ptr<float>(), found->second.values.data(), found->second.values.size() * sizeof(float));
}

void save_weights(const train::RunDirectory& run, const Transformer& transformer, const torch::Tensor& weights) {
  train::TensorFile file;
  const float* data = weights.data_ptr<float>();
  for (const Transformer::Parameter& parameter : transformer.parameters()) {
    int64_t count = 1;
    for (const int64_t length : parameter.shape) count *= length;
    const float* begin = data + parameter.begin;
    file.tensors[parameter.name] = {parameter.shape, {begin, begin + count}};
  }
  train::write_tensor_file(run.weights(), file);
}

void load_weights(const train::RunDirectory& run, Transformer& transformer) {
  const train::TensorFile file = train::read_tensor_file(run.weights());
  float* data = transformer.weights().data_ptr<float>();
  for (const Transformer::Parameter& parameter : transformer.parameters()) {
    const auto found = file.tensors.find(parameter.name);
    if (found == file.tensors.end()) throw InputError(run.weights() + ": " + parameter.name + ": missing");
    if (found->second.shape != parameter.shape) throw InputError(run.weights() + ": " + parameter.name + ": is of another shape");
    std::memcpy(data + parameter.begin, found->second.values.data(), found->second.values.size() * sizeof(float));
  }
}

class SamplerTrainer {
 public:
  SamplerTrainer(const SamplerRequest& request, const SamplerSettings& settings, const ModelSpace& space, const RowMatrix& training,
                 const RowMatrix& validation, nlohmann::json description)
      : request_(request),
        settings_(settings),
        run_{request.run},
        description_(std::move(description)),
        noise_(noise_schedule(settings, space.dimension())),
        training_(to_tensor(training)),
        order_(settings.seed, static_cast<size_t>(training.rows())),
        transformer_(settings.shape, settings.seed),
        average_(transformer_.weights().clone()),
        optimiser_(model::adamw_group(parameter_count(settings.shape)),
                   {.beta1 = settings.beta1, .beta2 = settings.beta2, .epsilon = 1e-8, .weight_decay = settings.weight_decay}) {
    make_validation(to_tensor(validation));
  }

  SamplerResult run() {
    start();
    train::Progress progress("sampler", request_.quiet);
    const train::InterruptGuard interrupt;
    double last_checkpoint = now_s();
    const double session_start = seconds_;
    const uint64_t session_first = iteration_;
    const train::Budget& budget = settings_.schedule.budget;
    double done = train::progress(budget, iteration_, seconds_);
    while (done < 1) {
      if (interrupt.requested() || (request_.stop_after > 0 && iteration_ >= request_.stop_after)) {
        save("interrupted");
        throw train::Interrupted(run_.path + ": stopped after " + std::to_string(iteration_) + " iterations; --resume goes on from here");
      }
      const double rate = train::learning_rate(settings_.schedule, iteration_, seconds_), before = now_s();
      const double loss = iterate(rate);
      seconds_ += now_s() - before;
      ++iteration_;
      record(loss, rate);
      done = train::progress(budget, iteration_, seconds_);
      const double speed = static_cast<double>(iteration_ - session_first) / std::max(1e-9, seconds_ - session_start);
      char line[160];
      std::snprintf(line, sizeof(line), "iteration %llu, loss %.5f, %.2f it/s", static_cast<unsigned long long>(iteration_), shown_loss_,
                    speed);
      progress.show(done, line);
      if (now_s() - last_checkpoint > request_.checkpoint_period_s && done < 1) {
        save("running");
        last_checkpoint = now_s();
      }
    }
    last_validation_ = validate();
    save("finished");
    return {.iteration = iteration_, .seconds = seconds_, .loss = shown_loss_, .validation_loss = last_validation_};
  }

 private:
  void make_validation(const torch::Tensor& members) {
    const int64_t size = training_.size(1), count = members.size(0);
    if (count == 0) return;
    validation_ = empty_batch(count * kValidationDraws, size);
    for (int64_t i = 0; i < count * kValidationDraws; ++i) {
      const double u = (static_cast<double>(i % kValidationDraws) + 0.5) / kValidationDraws;
      const torch::Tensor noise = draw_noise(settings_.seed, kValidationNoise, static_cast<uint64_t>(i), size);
      add_noisy(validation_, i, members[i / kValidationDraws], noise, noise_.level(u));
    }
  }

  void start() {
    if (!request_.resume || !std::filesystem::exists(run_.checkpoint())) return train::write_json(run_.run_json(), description_);
    const std::string path = run_.checkpoint();
    const train::TensorFile file = train::read_tensor_file(path);
    take_flat(path, file, "weights", transformer_.weights());
    take_flat(path, file, "average", average_);
    take_flat(path, file, "first_moment", optimiser_.first_moment);
    take_flat(path, file, "second_moment", optimiser_.second_moment);
    const auto number = [&](const char* key) {
      const auto found = file.metadata.find(key);
      double value = 0;
      if (found == file.metadata.end() ||
          std::from_chars(found->second.data(), found->second.data() + found->second.size(), value).ec != std::errc{} || !(value >= 0)) {
        throw InputError(path + ": " + key + ": missing or no number");
      }
      return value;
    };
    iteration_ = static_cast<uint64_t>(number("iteration")), seconds_ = number("seconds");
    optimiser_.steps = static_cast<int64_t>(number("optimiser_steps"));
    for (const nlohmann::json& row : description_.value("log", nlohmann::json::array())) {
      if (row.at(0).get<uint64_t>() > iteration_) break;
      rows_.push_back({row.at(0).get<uint64_t>(), row.at(1).get<double>(), row.at(2).get<double>(), row.at(3).get<double>(),
                       row.at(4).is_null() ? std::numeric_limits<double>::quiet_NaN() : row.at(4).get<double>()});
    }
  }

  double iterate(double rate) {
    const int64_t batch = settings_.batch, size = training_.size(1);
    NoisyBatch noisy = empty_batch(batch, size);
    for (int64_t i = 0; i < batch; ++i) {
      const uint64_t counter = iteration_ * static_cast<uint64_t>(batch) + static_cast<uint64_t>(i);
      const double u =
          (static_cast<double>(i) + static_cast<double>(train::random_unit(settings_.seed, kLevels, counter))) / static_cast<double>(batch);
      const auto member = static_cast<int64_t>(order_.item(counter));
      add_noisy(noisy, i, training_[member], draw_noise(settings_.seed, kNoise, counter, size), noise_.level(u));
    }
    transformer_.gradients().zero_();
    const torch::Tensor loss = torch::mse_loss(transformer_.forward(noisy.z, noisy.lambda, settings_.bf16), noisy.clean);
    const double value = loss.item<double>();
    if (!std::isfinite(value)) fail("the loss is not finite");
    loss.backward();
    if (!optimiser_.step(transformer_.weights(), transformer_.gradients(), rate)) fail("a gradient is not finite");
    // The average of a young run forgets faster, or it would remember the random start.
    const double age = static_cast<double>(iteration_ + 1), decay = std::min(settings_.ema, age / (age + 9));
    average_.lerp_(transformer_.weights(), 1 - decay);
    return value;
  }

  [[noreturn]] void fail(const char* what) const {
    throw InputError(run_.path + ": iteration " + std::to_string(iteration_) + ": " + what + "; the last checkpoint is kept");
  }

  // Loss of the moving average on the validation members, at noise that never changes.
  double validate() {
    if (!validation_.z.defined()) return std::numeric_limits<double>::quiet_NaN();
    const torch::NoGradGuard no_gradient;
    const torch::Tensor own = transformer_.weights().clone();
    transformer_.weights().copy_(average_);
    double sum = 0;
    const int64_t rows = validation_.z.size(0);
    for (int64_t first = 0; first < rows; first += settings_.batch) {
      const int64_t count = std::min<int64_t>(settings_.batch, rows - first);
      const auto part = [&](const torch::Tensor& all) { return all.narrow(0, first, count); };
      const torch::Tensor x = transformer_.forward(part(validation_.z), part(validation_.lambda), settings_.bf16);
      sum += torch::mse_loss(x, part(validation_.clean)).item<double>() * static_cast<double>(count);
    }
    transformer_.weights().copy_(own);
    return sum / static_cast<double>(rows);
  }

  void record(double loss, double rate) {
    sum_ += loss, ++count_;
    const double weight = std::max(kRunningMean, 1.0 / static_cast<double>(++shown_count_));
    shown_loss_ += weight * (loss - shown_loss_);
    if (iteration_ % kLogPeriod != 0) return;
    LogRow row{.iteration = iteration_, .seconds = seconds_, .learning_rate = rate, .loss = sum_ / static_cast<double>(count_)};
    if (iteration_ % kValidationPeriod == 0) row.validation_loss = last_validation_ = validate();
    rows_.push_back(row);
    sum_ = 0, count_ = 0;
  }

  void save_log() {
    std::string text = "iteration,seconds,learning_rate,loss,validation_loss\n";
    nlohmann::json log = nlohmann::json::array();
    for (const LogRow& row : rows_) {
      char line[160];
      std::snprintf(line, sizeof(line), "%llu,%.3f,%.6g,%.6f,", static_cast<unsigned long long>(row.iteration), row.seconds,
                    row.learning_rate, row.loss);
      text += line;
      if (std::isfinite(row.validation_loss)) std::snprintf(line, sizeof(line), "%.6f", row.validation_loss), text += line;
      text += "\n";
      const nlohmann::json validation = std::isfinite(row.validation_loss) ? nlohmann::json(row.validation_loss) : nlohmann::json();
      log.push_back({row.iteration, row.seconds, row.learning_rate, row.loss, validation});
    }
    throw_if_error(ports::write_file_atomically(run_.log(), std::as_bytes(std::span(text))), "cannot save");
    description_["log"] = std::move(log);
  }

  void save(const char* status) {
    train::TensorFile file;
    file.tensors["weights"] = flat(transformer_.weights());
    file.tensors["average"] = flat(average_);
    file.tensors["first_moment"] = flat(optimiser_.first_moment);
    file.tensors["second_moment"] = flat(optimiser_.second_moment);
    file.metadata["iteration"] = exact(static_cast<double>(iteration_));
    file.metadata["seconds"] = exact(seconds_);
    file.metadata["optimiser_steps"] = exact(static_cast<double>(optimiser_.steps));
    train::write_tensor_file(run_.checkpoint(), file);
    save_weights(run_, transformer_, average_);
    save_log();
    description_["status"] = status;
    description_["iterations"] = iteration_;
    description_["train_seconds"] = seconds_;
    description_["loss"] = shown_loss_;
    description_["validation_loss"] = std::isfinite(last_validation_) ? nlohmann::json(last_validation_) : nlohmann::json();
    description_["updated"] = train::utc_now();
    train::write_json(run_.run_json(), description_);
  }

  const SamplerRequest& request_;
  SamplerSettings settings_;
  train::RunDirectory run_;
  nlohmann::json description_;
  NoiseSchedule noise_;
  torch::Tensor training_;  // [N,D]
  NoisyBatch validation_;
  train::ShuffledOrder order_;
  Transformer transformer_;
  torch::Tensor average_;  // [P]
  model::Optimiser optimiser_;
  uint64_t iteration_ = 0;
  double seconds_ = 0;
  std::vector<LogRow> rows_;
  double sum_ = 0, shown_loss_ = 0, last_validation_ = std::numeric_limits<double>::quiet_NaN();
  uint64_t count_ = 0, shown_count_ = 0;
};

nlohmann::json describe(const SamplerRequest& request, const SamplerSettings& settings, const train::PackageFile& population,
                        const ModelSpace& space, size_t training, size_t validation) {
  return {{"format", kSamplerFormat},
          {"status", "running"},
          {"tool", "figurine-train " FIGURINE_VERSION},
          {"command", request.command},
          {"created", train::utc_now()},
          {"commit", train::current_commit()},
          {"machine", train::describe_machine()},
          {"settings", to_json(settings)},
          {"parameters", parameter_count(settings.shape)},
          {"macs_per_evaluation", mac_count(settings.shape)},
          {"dimension", space.dimension()},
          {"training_members", training},
          {"validation_members", validation},
          {"population",
           {{"path", request.population},
            {"name", population.package.population().name},
            {"hash", format_hash(population.package.content_hash())}}}};
}

struct Members {
  RowMatrix training, validation;  // [N,W]
};

Members members_of(const Population& population, const SamplerSettings& settings, const std::string& path) {
  const RowMatrix weights = evaluate::read_weights(population);
  Members members{rows_of(population, weights, Split::kTrain, settings.members), rows_of(population, weights, Split::kValidation)};
  if (members.training.rows() < 2) throw InputError(path + ": has fewer than two training members");
  if (settings.members > static_cast<uint32_t>(members.training.rows())) {
    throw InputError(path + ": has " + std::to_string(members.training.rows()) + " training members, " + std::to_string(settings.members) +
                     " were asked for");
  }
  return members;
}

std::vector<evaluate::Token> tokens_of(const Population& population) {
  return evaluate::weight_tokens(population.network, population.shape.size() / population.size());
}

nlohmann::json read_run(const train::RunDirectory& run) {
  if (!std::filesystem::exists(run.run_json())) {
    throw InputError(run.path + ": no run.json; is this a folder of figurine-train sampler?");
  }
  nlohmann::json json = train::read_json(run.run_json());
  if (!json.is_object() || !json.contains("population") || !json.contains("settings")) {
    throw InputError(run.run_json() + ": is no run of figurine-train sampler");
  }
  return json;
}

void check_population(const nlohmann::json& description, const train::PackageFile& population, const train::RunDirectory& run,
                      const std::string& path) {
  const std::string own = description.at("population").value("hash", ""), given = format_hash(population.package.content_hash());
  if (own != given) throw InputError(run.path + ": was trained on population " + own + ", " + path + " is " + given);
}

}  // namespace

RowMatrix rows_of(const Population& population, const RowMatrix& weights, Split split, uint32_t most) {
  std::vector<Eigen::Index> rows;
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split == split && (most == 0 || rows.size() < most)) rows.push_back(static_cast<Eigen::Index>(m));
  }
  return weights(rows, Eigen::all);
}

bool is_sampler_run(const std::string& path) {
  const train::RunDirectory run{path};
  if (!std::filesystem::exists(run.run_json())) return false;
  const nlohmann::json json = train::read_json(run.run_json());
  return json.is_object() && json.contains("population") && json.contains("training_members");
}

SamplerResult train_sampler(const SamplerRequest& request) {
  const train::RunDirectory run{request.run};
  const bool exists = std::filesystem::exists(run.run_json());
  if (exists && !request.resume) throw InputError(request.run + ": holds a run already; --resume goes on with it");
  if (!exists && request.resume) throw InputError(request.run + ": no run to resume (run.json is missing)");
  const train::PackageFile population = train::open_package(request.population, PackageKind::kPopulation);
  SamplerSettings settings = request.settings;
  nlohmann::json description;
  if (exists) {
    description = read_run(run);
    check_population(description, population, run, request.population);
    settings = sampler_settings_from_json(description.at("settings"), run.run_json());
    settings.threads = request.settings.threads;
    if (description.value("status", "") == "finished") {
      const nlohmann::json validation = description.value("validation_loss", nlohmann::json());
      return {.iteration = description.value("iterations", uint64_t{0}),
              .seconds = description.value("train_seconds", 0.0),
              .loss = description.value("loss", 0.0),
              .validation_loss = validation.is_number() ? validation.get<double>() : std::numeric_limits<double>::quiet_NaN(),
              .was_finished = true};
    }
  }
  const Members members = members_of(population.package.population(), settings, request.population);
  const ModelSpace space(members.training, tokens_of(population.package.population()), settings.space);
  settings.shape.token_sizes.assign(space.token_sizes().begin(), space.token_sizes().end());
  check(settings.shape);
  noise_schedule(settings, space.dimension());
  if (!exists) {
    std::error_code error;
    std::filesystem::create_directories(request.run, error);
    if (error) throw InputError(request.run + ": cannot be created: " + error.message());
    description = describe(request, settings, population, space, static_cast<size_t>(members.training.rows()),
                           static_cast<size_t>(members.validation.rows()));
  }
  at::set_num_threads(static_cast<int>(settings.threads));
  return SamplerTrainer(request, settings, space, space.encode(members.training), space.encode(members.validation), std::move(description))
      .run();
}

TrainedSampler TrainedSampler::open(const std::string& path, const std::string& population) {
  const train::RunDirectory run{path};
  const nlohmann::json description = read_run(run);
  TrainedSampler sampler;
  sampler.settings = sampler_settings_from_json(description.at("settings"), run.run_json());
  const std::string where = population.empty() ? description.at("population").value("path", "") : population;
  sampler.population = std::make_unique<train::PackageFile>(train::open_package(where, PackageKind::kPopulation));
  check_population(description, *sampler.population, run, where);
  const Population& people = sampler.population->package.population();
  const Members members = members_of(people, sampler.settings, where);
  sampler.space = std::make_unique<ModelSpace>(members.training, tokens_of(people), sampler.settings.space);
  sampler.training = sampler.space->encode(members.training);
  sampler.transformer = std::make_unique<Transformer>(sampler.settings.shape, sampler.settings.seed);
  load_weights(run, *sampler.transformer);
  return sampler;
}

}  // namespace figurine::generate
