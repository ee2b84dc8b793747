#include "toolchain/generate/sampler_trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "figurine/detail/noise_level.h"
#include "ports/host/folder_lock.h"
#include "toolchain/error.h"
#include "toolchain/generate/autoencoder.h"
#include "toolchain/generate/flat_trainer.h"
#include "toolchain/generate/people_mixer.h"
#include "toolchain/generate/tensors.h"
#include "toolchain/model/threads.h"
#include "toolchain/random/counter.h"
#include "toolchain/random/shuffled_order.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/run_directory.h"

namespace figurine::generate {

using measure::RowMatrix;

namespace {

constexpr int kSamplerFormat = 1;
constexpr int64_t kValidationDraws =
    16;  // noise levels for each validation member, always the same ones
enum Stream : uint64_t { kLevels = 1, kNoise = 2, kValidationNoise = 3, kMixed = 4, kDropout = 5 };

struct NoisyBatch {
  torch::Tensor z, lambda, clean;  // [B,D], [B], [B,D]
};

// One row of a batch: member x at the schedule's place u.
void add_noisy(NoisyBatch& batch, int64_t row, const torch::Tensor& x, const torch::Tensor& noise,
               const NoiseLevel& level) {
  batch.clean[row].copy_(x);
  batch.z[row].copy_(x * level.alpha + noise * level.sigma);
  batch.lambda[row] = level.lambda;
}

NoisyBatch empty_batch(int64_t rows, int64_t size) {
  return {torch::empty({rows, size}), torch::empty({rows}, torch::kFloat64),
          torch::empty({rows, size})};
}

// Members, and the people that are mixed of them, as model vectors.
class LearntPeople {
 public:
  // mixer: none where only members are learnt from. Borrowed.
  LearntPeople(const RowMatrix& training, const ModelSpace& space, const PeopleMixer* mixer)
      : members_(to_tensor(space.encode(training))),
        token_sizes_(space.token_sizes()),
        mixer_(mixer) {}

  int64_t count() const { return members_.size(0); }
  int64_t size() const { return members_.size(1); }
  torch::Tensor member(size_t m) const { return members_[static_cast<int64_t>(m)]; }
  // Token by token of whom it is.
  torch::Tensor mixed(size_t m, uint64_t seed, uint64_t counter) const {
    const MixedPerson person = mixer_->draw(seed, counter, m);
    torch::Tensor values = member(person.base).clone();
    int64_t at = 0;
    for (size_t l = 0; l < token_sizes_.size(); ++l) {
      const auto size = static_cast<int64_t>(token_sizes_[l]);
      const size_t donor = mixer_->donor(person, l);
      if (donor != person.base) values.narrow(0, at, size).copy_(member(donor).narrow(0, at, size));
      at += size;
    }
    return values;
  }

 private:
  torch::Tensor members_;  // [N,D]
  std::vector<size_t> token_sizes_;
  const PeopleMixer* mixer_;
};

// The denoiser and the batches that it learns from.
class Denoising : public FlatModel {
 public:
  Denoising(const SamplerSettings& settings, size_t dimension, const LearntPeople& training,
            const RowMatrix& validation)
      : settings_(settings),
        noise_(noise_schedule(settings, dimension)),
        training_(training),
        order_(settings.seed, static_cast<size_t>(training.count())),
        transformer_(settings.shape, settings.seed) {
    make_validation(to_tensor(validation));
  }

  const Transformer& transformer() const { return transformer_; }
  torch::Tensor& weights() override { return transformer_.weights(); }
  torch::Tensor& gradients() override { return transformer_.gradients(); }

  torch::Tensor loss(uint64_t iteration, Share share) override {
    const int64_t batch = settings_.batch, size = training_.size();
    NoisyBatch noisy = empty_batch(share.count, size);
    for (int64_t row = 0; row < share.count; ++row) {
      const int64_t place = share.first + row;
      const uint64_t counter =
          iteration * static_cast<uint64_t>(batch) + static_cast<uint64_t>(place);
      const double u = (static_cast<double>(place) + static_cast<double>(random::random_unit(
                                                         settings_.seed, kLevels, counter))) /
                       static_cast<double>(batch);
      const size_t member = order_.item(counter);
      const bool mixed =
          double{random::random_unit(settings_.seed, kMixed, counter)} < settings_.mixed_share;
      const torch::Tensor person =
          mixed ? training_.mixed(member, settings_.seed, counter) : training_.member(member);
      add_noisy(noisy, row, person, draw_noise(settings_.seed, kNoise, counter, size),
                noise_.level(u));
    }
    if (settings_.dropout > 0) {
      // By iteration and place: a training that goes on leaves out what it would have left out.
      torch::manual_seed(
          random::CounterRandom(settings_.seed, kDropout)
              .bits(iteration * static_cast<uint64_t>(batch) + static_cast<uint64_t>(share.first)));
    }
    return error(transformer_.forward(noisy.z, noisy.lambda, settings_.bf16, settings_.dropout),
                 noisy);
  }

  // At noise that never changes.
  double validation_loss() override {
    if (!validation_.z.defined()) return std::numeric_limits<double>::quiet_NaN();
    double sum = 0;
    const int64_t rows = validation_.z.size(0);
    for (int64_t first = 0; first < rows; first += settings_.batch) {
      const int64_t count = std::min<int64_t>(settings_.batch, rows - first);
      const auto part = [&](const torch::Tensor& all) { return all.narrow(0, first, count); };
      const NoisyBatch noisy{part(validation_.z), part(validation_.lambda),
                             part(validation_.clean)};
      const torch::Tensor x = transformer_.forward(noisy.z, noisy.lambda, settings_.bf16);
      sum += error(x, noisy).item<double>() * static_cast<double>(count);
    }
    return sum / static_cast<double>(rows);
  }

 private:
  // Mean square of what the last layer is wrong by: x, or, of flow matching, (x - clean) / t.
  torch::Tensor error(const torch::Tensor& x, const NoisyBatch& noisy) const {
    if (settings_.shape.prediction == Prediction::kClean) return torch::mse_loss(x, noisy.clean);
    return ((x - noisy.clean) / noise_share(noisy.lambda).unsqueeze(1)).square().mean();
  }

  void make_validation(const torch::Tensor& members) {
    const int64_t size = training_.size(), count = members.size(0);
    if (count == 0) return;
    validation_ = empty_batch(count * kValidationDraws, size);
    for (int64_t i = 0; i < count * kValidationDraws; ++i) {
      const double u = (static_cast<double>(i % kValidationDraws) + 0.5) / kValidationDraws;
      const torch::Tensor noise =
          draw_noise(settings_.seed, kValidationNoise, static_cast<uint64_t>(i), size);
      add_noisy(validation_, i, members[i / kValidationDraws], noise, noise_.level(u));
    }
  }

  SamplerSettings settings_;
  NoiseSchedule noise_;
  LearntPeople training_;
  NoisyBatch validation_;
  random::ShuffledOrder order_;
  Transformer transformer_;
};

nlohmann::json describe(const SamplerRequest& request, const SamplerSettings& settings,
                        const train::PackageFile& population, size_t dimension, size_t training,
                        size_t validation) {
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
          {"dimension", dimension},
          {"training_members", training},
          {"validation_members", validation},
          {"population",
           {{"path", request.population},
            {"name", population.package.population().name},
            {"hash", format_hash(population.package.content_hash())}}},
          {"body", request.body}};
}

// What a population gives to learn from.
struct Members {
  std::unique_ptr<measure::WeightLayout> layout;
  RowMatrix training, validation;  // [N,W]
  std::optional<PeopleMixer> mixer;
};

// body: a path; not looked at where no member has a static part.
Members members_of(const Population& population, const SamplerSettings& settings,
                   const std::string& path, const std::string& body) {
  Members members;
  std::optional<train::PackageFile> opened;
  if (population.static_part.empty()) {
    if (settings.mixed_share > 0)
      throw InputError(path + ": its members have no static values, there is nothing to mix");
    members.layout = std::make_unique<measure::WeightLayout>(
        population.network, population.shape.size() / population.size());
  } else {
    if (body.empty()) throw InputError(path + ": its members have static parts: say --body");
    opened.emplace(train::open_package(body, PackageKind::kBody));
    if (opened->package.content_hash() != population.body_hash) {
      throw InputError(body + ": is " + format_hash(opened->package.content_hash()) + ", " + path +
                       " stands on " + format_hash(population.body_hash));
    }
    members.layout = std::make_unique<measure::WeightLayout>(population, opened->package.body(),
                                                             settings.pieces);
  }
  const RowMatrix weights = members.layout->read(population);
  members.training = rows_of(population, weights, Split::kTrain, settings.members);
  members.validation = rows_of(population, weights, Split::kValidation);
  if (members.training.rows() < 2) throw InputError(path + ": has fewer than two training members");
  if (settings.members > static_cast<uint32_t>(members.training.rows())) {
    throw InputError(path + ": has " + std::to_string(members.training.rows()) +
                     " training members, " + std::to_string(settings.members) + " were asked for");
  }
  if (settings.mixed_share > 0) {
    if (settings.space.variant != Variant::kLayer && settings.space.variant != Variant::kBasis) {
      throw InputError(std::string("variant ") + to_string(settings.space.variant) +
                       ": its tokens are no parts of a body, nobody can be mixed in it");
    }
    members.mixer.emplace(members.training, *members.layout, population, opened->package.body());
  }
  return members;
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

void check_population(const nlohmann::json& description, const train::PackageFile& population,
                      const train::RunDirectory& run, const std::string& path) {
  const std::string own = description.at("population").value("hash", ""),
                    given = format_hash(population.package.content_hash());
  if (own != given)
    throw InputError(run.path + ": was trained on population " + own + ", " + path + " is " +
                     given);
}

}  // namespace

RowMatrix rows_of(const Population& population, const RowMatrix& weights, Split split,
                  uint32_t most) {
  std::vector<Eigen::Index> rows;
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split == split && (most == 0 || rows.size() < most))
      rows.push_back(static_cast<Eigen::Index>(m));
  }
  return weights(rows, Eigen::all);
}

bool is_sampler_run(const std::string& path) {
  const train::RunDirectory run{path};
  if (!std::filesystem::exists(run.run_json())) return false;
  const nlohmann::json json = train::read_json(run.run_json());
  return json.is_object() && json.contains("population") && json.contains("training_members");
}

namespace {

// What rank 0 finds in the run's folder; the other ranks hear of it, and need no such folder.
struct Plan {
  SamplerSettings settings;
  nlohmann::json description;  // empty: a new run; rank 0's alone
  bool finished = false;
};

Plan make_plan(const SamplerRequest& request, const train::PackageFile& population) {
  const train::RunDirectory run{request.run};
  const bool exists = std::filesystem::exists(run.run_json());
  if (exists && !request.resume)
    throw InputError(request.run + ": holds a run already; --resume goes on with it");
  if (!exists && request.resume)
    throw InputError(request.run + ": no run to resume (run.json is missing)");
  Plan plan{.settings = request.settings, .description = {}};
  if (!exists) {
    if (plan.settings.threads == 0) plan.settings.threads = model::default_threads();
    return plan;
  }
  plan.description = read_run(run);
  check_population(plan.description, population, run, request.population);
  plan.settings = sampler_settings_from_json(plan.description.at("settings"), run.run_json());
  if (request.settings.threads > 0) plan.settings.threads = request.settings.threads;
  plan.finished = plan.description.value("status", "") == "finished";
  return plan;
}

nlohmann::json without_threads(nlohmann::json settings) {
  settings.erase("threads");
  return settings;
}

// Tells rank 0's plan to all ranks.
void share_plan(Plan& plan, ProcessGroup& group, const SamplerRequest& request,
                const train::PackageFile& population) {
  const std::string hash = format_hash(population.package.content_hash());
  nlohmann::json told;
  if (group.leads()) {
    told = {{"settings", to_json(plan.settings)},
            {"new", plan.description.empty()},
            {"finished", plan.finished},
            {"population", hash}};
  }
  told = nlohmann::json::parse(group.broadcast(told.dump()));
  if (told.at("population").get<std::string>() != hash) {
    throw InputError(group.name() + ": " + request.population + " is " + hash + ", rank 0 has " +
                     told.at("population").get<std::string>());
  }
  if (!group.leads()) {
    if (!told.at("new").get<bool>()) {
      plan.settings = sampler_settings_from_json(told.at("settings"), group.name());
      if (request.settings.threads > 0) plan.settings.threads = request.settings.threads;
    } else if (without_threads(told.at("settings")) == without_threads(to_json(request.settings))) {
      plan.settings = request.settings;
      if (plan.settings.threads == 0)
        plan.settings.threads = told.at("settings").at("threads").get<uint32_t>();
    } else {
      throw InputError(group.name() + ": was asked for other settings than rank 0");
    }
    plan.finished = told.at("finished").get<bool>();
  }
}

SamplerResult result_of(const nlohmann::json& description) {
  const nlohmann::json validation = description.value("validation_loss", nlohmann::json());
  return {.iteration = description.value("iterations", uint64_t{0}),
          .seconds = description.value("train_seconds", 0.0),
          .loss = description.value("loss", 0.0),
          .validation_loss = validation.is_number() ? validation.get<double>()
                                                    : std::numeric_limits<double>::quiet_NaN(),
          .was_finished = true};
}

nlohmann::json to_json(const FlatProgress& progress, const char* status) {
  return {{"status", status},
          {"iterations", progress.iteration},
          {"train_seconds", progress.seconds},
          {"loss", progress.loss},
          {"validation_loss", std::isfinite(progress.validation_loss)
                                  ? nlohmann::json(progress.validation_loss)
                                  : nlohmann::json()},
          {"log", log_to_json(progress.log)}};
}

// Seconds of one evaluation of one vector: the median of a few.
double time_evaluation(const Transformer& transformer, const SamplerSettings& settings) {
  constexpr int kTimes = 5;
  const torch::NoGradGuard no_gradient;
  const torch::Tensor z =
      torch::zeros({1, std::accumulate(settings.shape.token_sizes.begin(),
                                       settings.shape.token_sizes.end(), int64_t{0})});
  const torch::Tensor lambda = torch::zeros({1}, torch::kFloat64);
  std::vector<double> seconds;
  for (int i = 0; i <= kTimes; ++i) {  // the first one does not count
    const auto start = std::chrono::steady_clock::now();
    transformer.forward(z, lambda, settings.bf16);
    if (i > 0)
      seconds.push_back(
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::nth_element(seconds.begin(), seconds.begin() + kTimes / 2, seconds.end());
  return seconds[kTimes / 2];
}

// The run's files besides the checkpoint, after one was written.
void save_run(const train::RunDirectory& run, nlohmann::json& description,
              const Transformer& transformer, const torch::Tensor& average, const char* status,
              const FlatProgress& progress) {
  save_parameters(run.weights(), transformer.layout(), average);
  save_log(run.log(), progress.log);
  description.update(to_json(progress, status));
  description["updated"] = train::utc_now();
  train::write_json(run.run_json(), description);
}

}  // namespace

namespace {

std::string autoencoder_file(const train::RunDirectory& run) {
  return run.path + "/autoencoder.safetensors";
}
std::string autoencoder_log(const train::RunDirectory& run) {
  return run.path + "/autoencoder_log.csv";
}
std::string autoencoder_checkpoint(const train::RunDirectory& run) {
  return run.path + "/autoencoder_checkpoint.safetensors";
}

FlatTraining training_of(const SamplerRequest& request, const SamplerSettings& settings) {
  return {.title = "sampler",
          .run = request.run,
          .checkpoint = train::RunDirectory{request.run}.checkpoint(),
          .settings_hash = train::hash_of_settings(to_json(settings)),
          .batch = settings.batch,
          .schedule = settings.schedule,
          .beta1 = settings.beta1,
          .beta2 = settings.beta2,
          .weight_decay = settings.weight_decay,
          .ema = settings.ema,
          .checkpoint_period_s = request.checkpoint_period_s,
          .stop_after = request.stop_after,
          .quiet = request.quiet};
}

// Stage one of variant `latent`. Where it is done already it only takes what it was done with.
// description: the run's, on rank 0.
void train_autoencoder(const std::shared_ptr<Autoencoder>& autoencoder,
                       const SamplerRequest& request, const SamplerSettings& settings,
                       const Members& members, const std::vector<measure::Token>& tokens,
                       ProcessGroup& group, nlohmann::json& description) {
  const train::RunDirectory run{request.run};
  const measure::Standardisation standardisation(members.training, tokens);
  Autoencoding autoencoding(autoencoder, settings, standardisation.standardise(members.training),
                            standardisation.standardise(members.validation));
  FlatTraining training = training_of(request, settings);
  training.title = "autoencoder", training.checkpoint = autoencoder_checkpoint(run),
  training.schedule = settings.autoencoder.schedule;
  FlatTrainer trainer(
      autoencoding, group, training, [&](const char* status, const FlatProgress& progress) {
        save_parameters(autoencoder_file(run), autoencoder->parameters().layout(),
                        trainer.average());
        save_log(autoencoder_log(run), progress.log);
        description["autoencoder"] = to_json(progress, status);
        description["status"] = status == std::string("finished") ? "running" : status;
        train::write_json(run.run_json(), description);
      });
  if (group.leads() && request.resume) {
    const nlohmann::json before = description.value("autoencoder", nlohmann::json::object());
    trainer.resume(before.value("log", nlohmann::json::array()));
  }
  trainer.run();
  autoencoding.weights().copy_(trainer.average());
}

ModelSpace make_space(const Members& members, const SamplerSettings& settings,
                      std::shared_ptr<const WeightCodec> codec) {
  return {members.training, members.layout->tokens(), settings.space, std::move(codec)};
}

}  // namespace

SamplerResult train_sampler(const SamplerRequest& request) {
  const train::RunDirectory run{request.run};
  ProcessGroup group(request.place, request.rank_timeout_s);
  const train::PackageFile population = train::open_population(request.population);
  std::optional<ports::FolderLock> lock;  // of two trainings in one folder the slower one would win
  const auto lock_run = [&] {
    lock.emplace(value_or_throw(ports::FolderLock::acquire(request.run), "cannot train"));
  };
  if (group.leads() && std::filesystem::exists(run.run_json())) lock_run();
  Plan plan = group.leads() ? make_plan(request, population) : Plan{};
  share_plan(plan, group, request, population);
  if (plan.finished)
    return group.leads() ? result_of(plan.description) : SamplerResult{.was_finished = true};
  SamplerSettings& settings = plan.settings;
  const Members members = members_of(population.package.population(), settings, request.population,
                                     request.body.empty() && !plan.description.empty()
                                         ? plan.description.value("body", "")
                                         : request.body);
  const std::vector<measure::Token>& tokens = members.layout->tokens();
  model::use_threads(settings.threads);

  // What can be wrong is found before anything is written: the tokens of `latent` are known before
  // its autoencoder is trained.
  std::shared_ptr<Autoencoder> autoencoder;
  if (settings.space.variant == Variant::kLatent) {
    autoencoder = std::make_shared<Autoencoder>(static_cast<size_t>(members.training.cols()),
                                                settings.autoencoder, settings.seed);
  }
  std::optional<ModelSpace> space;
  if (!autoencoder) space.emplace(make_space(members, settings, nullptr));
  const std::vector<size_t>& token_sizes =
      autoencoder ? autoencoder->token_sizes() : space->token_sizes();
  settings.shape.token_sizes.assign(token_sizes.begin(), token_sizes.end());
  check(settings.shape);
  check_batch(settings.batch, group, request.run);
  const size_t dimension = space
                               ? space->dimension()
                               : std::accumulate(token_sizes.begin(), token_sizes.end(), size_t{0});
  noise_schedule(settings, dimension);
  if (group.leads() && plan.description.empty()) {
    std::error_code error;
    std::filesystem::create_directories(request.run, error);
    if (error) throw InputError(request.run + ": cannot be created: " + error.message());
    lock_run();
    plan.description = describe(request, settings, population, dimension,
                                static_cast<size_t>(members.training.rows()),
                                static_cast<size_t>(members.validation.rows()));
    train::write_json(run.run_json(), plan.description);
  }
  if (autoencoder) {
    train_autoencoder(autoencoder, request, settings, members, tokens, group, plan.description);
    space.emplace(make_space(members, settings, autoencoder));
  }

  const PeopleMixer* mixer = members.mixer ? &*members.mixer : nullptr;
  Denoising denoising(settings, dimension, {members.training, *space, mixer},
                      space->encode(members.validation));
  FlatTrainer trainer(denoising, group, training_of(request, settings),
                      [&](const char* status, const FlatProgress& progress) {
                        if (status == std::string("finished"))
                          plan.description["seconds_per_evaluation"] =
                              time_evaluation(denoising.transformer(), settings);
                        save_run(run, plan.description, denoising.transformer(), trainer.average(),
                                 status, progress);
                      });
  if (group.leads() && request.resume)
    trainer.resume(plan.description.value("log", nlohmann::json::array()));
  const FlatProgress progress = trainer.run();
  return {.iteration = progress.iteration,
          .seconds = progress.seconds,
          .loss = progress.loss,
          .validation_loss = progress.validation_loss,
          .weights_hash = hash_bits(denoising.weights())};
}

TrainedSampler TrainedSampler::open(const std::string& path, const std::string& population,
                                    const std::string& body) {
  const train::RunDirectory run{path};
  const nlohmann::json description = read_run(run);
  TrainedSampler sampler;
  sampler.settings = sampler_settings_from_json(description.at("settings"), run.run_json());
  const std::string where =
      population.empty() ? description.at("population").value("path", "") : population;
  sampler.population = std::make_unique<train::PackageFile>(train::open_population(where));
  check_population(description, *sampler.population, run, where);
  const Population& people = sampler.population->package.population();
  Members members = members_of(people, sampler.settings, where,
                               body.empty() ? description.value("body", "") : body);
  std::shared_ptr<Autoencoder> autoencoder;
  if (sampler.settings.space.variant == Variant::kLatent) {
    autoencoder =
        std::make_shared<Autoencoder>(static_cast<size_t>(members.training.cols()),
                                      sampler.settings.autoencoder, sampler.settings.seed);
    load_parameters(autoencoder_file(run), autoencoder->parameters().layout(),
                    autoencoder->parameters().weights());
  }
  sampler.space = std::make_unique<ModelSpace>(make_space(members, sampler.settings, autoencoder));
  sampler.training = sampler.space->encode(members.training);
  sampler.layout = std::move(members.layout);
  sampler.transformer =
      std::make_unique<Transformer>(sampler.settings.shape, sampler.settings.seed);
  load_parameters(run.weights(), sampler.transformer->layout(), sampler.transformer->weights());
  return sampler;
}

}  // namespace figurine::generate
