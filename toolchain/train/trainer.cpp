#include "toolchain/train/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "ports/host/folder_lock.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/error.h"
#include "toolchain/model/allocator.h"
#include "toolchain/model/loss.h"
#include "toolchain/model/network_adapter.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/model/threads.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/describe_run.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/kernel_basis_file.h"
#include "toolchain/train/lanes.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/person.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/reference_gaussians.h"
#include "toolchain/train/sample_feed.h"
#include "toolchain/train/standoff.h"

namespace figurine::train {

namespace {

constexpr uint64_t kLogPeriod = 50;  // iterations per row
constexpr double kRunningMean =
    0.02;  // weight of the newest iteration in what the progress bar shows

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Adds the time since the last call to a stage.
class StageClock {
 public:
  void add(double& stage) {
    const double now = now_s();
    stage += now - last_;
    last_ = now;
  }

 private:
  double last_ = now_s();
};

// Means over the iterations since the last log row.
struct Means {
  double loss = 0, squared_error = 0;
  uint64_t foreground = 0, count = 0;
  double psnr_db() const {
    return foreground == 0 || squared_error <= 0
               ? 0
               : -10 * std::log10(squared_error / (3.0 * static_cast<double>(foreground)));
  }
};

struct IterationResult {
  double loss = 0, squared_error = 0;
  uint64_t foreground = 0;
};

// What one pose of an iteration gave.
struct PoseResult {
  IterationResult result;
  torch::Tensor gradients;         // [P] of the network; undefined without one
  torch::Tensor static_gradients;  // of the static values; undefined without any
  StageSeconds stages;
};

uint32_t threads_a_lane(const TrainSettings& settings) {
  return settings.threads / lane_count(settings);
}

// That LibTorch computes a lane's network with. The convolutions of 64 cells a side and fewer take
// less than it takes to share them: on two cores a backward pass was 4 ms on one thread, 32 on two.
uint32_t network_threads(const TrainSettings& settings) {
  constexpr uint32_t kLargestAlone = 64;
  return network_side(settings) <= kLargestAlone ? 1 : threads_a_lane(settings);
}

// Of what learns of the network: all of it, its adapter's factors, or nothing.
std::vector<model::ParameterGroup> network_groups(const AvatarModel& model,
                                                  const model::NetworkAdapter* adapter) {
  const TrainSettings& settings = model.settings();
  if (adapter != nullptr)
    return model::adamw_group(static_cast<uint64_t>(adapter->factors().numel()));
  if (!model.has_network() || settings.freeze_network) return {};
  return settings.optimiser == OptimiserKind::kMuon
             ? model.unet().muon_groups()
             : model::adamw_group(model.unet().parameter_count());
}

std::unique_ptr<model::NetworkAdapter> make_adapter(const AvatarModel& model) {
  const TrainSettings& settings = model.settings();
  const AdapterSettings& adapter = settings.adapter;
  if (adapter.rank == 0) return nullptr;
  model::AdapterOptions options{
      .kind = adapter.kind, .rank = adapter.rank, .seed = settings.seed, .basis = {}};
  if (!adapter.basis.empty()) options.basis = read_kernel_basis(adapter.basis);
  return std::make_unique<model::NetworkAdapter>(model.unet(), std::move(options));
}

using People = std::vector<std::unique_ptr<Person>>;

class Trainer {
 public:
  // description: run.json of all together; with one person that person's.
  Trainer(const TrainRequest& request, const TrainSettings& settings, People people,
          nlohmann::json description)
      : request_(request),
        settings_(settings),
        run_{request.run},
        description_(std::move(description)),
        people_(std::move(people)),
        adapter_(make_adapter(model())),
        optimiser_(network_groups(model(), adapter_.get()),
                   adamw_options(settings, settings.weight_decay)) {
    for (size_t p = 1; p < people_.size(); ++p) people_[p]->share_network(*people_[0]);
    if (request.fake_quantisation == nullptr) return;
    for (unsigned lane = 0; lane < lane_count(settings_); ++lane)
      people_[0]->model(lane).unet().set_fake_quantisation(request.fake_quantisation);
  }

  TrainResult run() {
    start();
    for (size_t p = 0; p < people_.size(); ++p)
      people_[p]->start_feed(iterations_of(p) * settings_.poses_per_iteration);
    Progress progress(title(), request_.quiet);
    const InterruptGuard interrupt;
    double last_checkpoint = now_s();
    const double session_start = state_.seconds;
    const uint64_t session_first = state_.iteration;
    double done = train::progress(settings_.schedule.budget, state_.iteration, state_.seconds);
    while (done < 1) {
      if (interrupt.requested() ||
          (request_.stop_after > 0 && state_.iteration >= request_.stop_after)) {
        save("interrupted");
        throw Interrupted(run_.path + ": stopped after " + std::to_string(state_.iteration) +
                          " iterations; --resume goes on from here");
      }
      const double rate = learning_rate(settings_.schedule, state_.iteration, state_.seconds);
      const double before = now_s();
      const IterationResult result = iterate(rate);
      state_.seconds += now_s() - before;
      ++state_.iteration;
      record(result, rate);
      done = train::progress(settings_.schedule.budget, state_.iteration, state_.seconds);
      const double speed = static_cast<double>(state_.iteration - session_first) /
                           std::max(1e-9, state_.seconds - session_start);
      const double seconds_left =
          settings_.schedule.budget.iterations > 0
              ? static_cast<double>(settings_.schedule.budget.iterations - state_.iteration) /
                    std::max(1e-9, speed)
              : settings_.schedule.budget.seconds - state_.seconds;
      progress.show(done, TrainingLine{.iteration = state_.iteration,
                                       .loss = shown_loss_,
                                       .psnr_db = shown_psnr(),
                                       .iterations_per_second = speed,
                                       .seconds_left = seconds_left});
      if (now_s() - last_checkpoint > request_.checkpoint_period_s && done < 1) {
        save("running");
        last_checkpoint = now_s();
      }
    }
    save("finished");
    return {.state = state_, .loss = shown_loss_, .psnr_db = shown_psnr()};
  }

 private:
  // Whose network is everybody's.
  AvatarModel& model() { return people_[0]->model(); }

  bool network_learns() const {
    return settings_.network && (!settings_.freeze_network || adapter_ != nullptr);
  }

  std::string title() const {
    return people_.size() == 1 ? std::filesystem::path(request_.data).filename().string()
                               : std::to_string(people_.size()) + " people";
  }

  // People take turns. How many iterations person p has had.
  uint64_t iterations_of(size_t p) const {
    return (state_.iteration + people_.size() - 1 - p) / people_.size();
  }

  LearnedParts parts() {
    LearnedParts parts = model().parts();
    parts.adapter = adapter_.get();
    return parts;
  }

  PartOptimisers optimisers() {
    return {.unet = network_learns() ? &optimiser_ : nullptr,
            .statics = model().statics().empty() ? nullptr : &people_[0]->static_optimiser};
  }

  std::vector<FurtherPerson> further() {
    std::vector<FurtherPerson> further;
    for (size_t p = 1; p < people_.size(); ++p)
      further.push_back({&people_[p]->model().statics(), &people_[p]->static_optimiser});
    return further;
  }

  // What a package in fixed point holds of the static values.
  void round_statics() {
    const model::HeadLayout layout = head_layout(settings_);
    take_static_part(RoundedMap(model().statics(), layout).view(), layout, model().statics());
  }

  void start() {
    if (request_.resume && std::filesystem::exists(run_.checkpoint())) {
      state_ = load_checkpoint(run_, parts(), optimisers(), further());
      if (state_.settings_hash != hash_of_settings(to_json(settings_)))
        throw InputError(run_.run_json() + ": settings: are not those of checkpoint.safetensors");
      rows_ = load_log(run_, state_.iteration);
      measure_smallest_extents(1);  // the checkpoint has the first person's
    } else {
      begin();
    }
    const uint64_t warmup = settings_.warmup_iterations;
    for (size_t p = 0; p < people_.size(); ++p) {
      if (iterations_of(p) < warmup)
        people_[p]->reference = reference_head(people_[p]->data(), people_[p]->model());
    }
  }

  // Of the people from `first` on.
  void measure_smallest_extents(size_t first) {
    for (size_t p = first; p < people_.size(); ++p) {
      Person& person = *people_[p];
      if (SmallestExtentMap* extents = person.model().smallest_extents())
        round_extents(measure_extents(person.data(), person.model()), person.data().directory(),
                      *extents);
    }
  }

  void begin() {
    if (!settings_.init.empty()) {
      // The network is everybody's, so it comes again with everybody's static values.
      for (const auto& person : people_)
        load_initial_weights(settings_.init, person->model().parts());
    }
    if (adapter_) adapter_->set_base(model().unet().weights());
    if (request_.fake_quantisation != nullptr) round_statics();
    measure_smallest_extents(0);
    description_["parts"] = describe_parts(model());
    if (people_.size() > 1) {
      for (const auto& person : people_) {
        make_folder(person->run.path);
        person->description["parts"] = description_["parts"];
        write_json(person->run.run_json(), person->description);
      }
    }
    write_json(run_.run_json(), description_);
    state_.settings_hash = hash_of_settings(to_json(settings_));
  }

  IterationResult iterate(double rate) {
    StageClock clock;
    Person& person = *people_[state_.iteration % people_.size()];
    const uint32_t count = settings_.poses_per_iteration, lanes = lane_count(settings_);
    std::vector<Sample> samples;
    for (uint32_t i = 0; i < count; ++i) samples.push_back(person.next_sample());
    clock.add(state_.stages.data);
    std::vector<PoseResult> poses(count);
    const double fade =
        standoff_fade(train::progress(settings_.schedule.budget, state_.iteration, state_.seconds));
    lanes_.run([&](unsigned lane) {
      for (uint32_t i = lane; i < count; i += lanes)
        poses[i] = pose_iteration(samples[i], person, lane, fade);
    });
    for (size_t i = 0; i < count; i += lanes) add_stages(poses[i].stages);
    StageClock last;
    IterationResult result;
    // In the order of the poses, whatever thread they ran on.
    torch::Tensor gradients = poses[0].gradients, static_gradients = poses[0].static_gradients;
    for (uint32_t i = 0; i < count; ++i) {
      if (!std::isfinite(poses[i].result.loss)) fail(person, samples[i], "the loss is not finite");
      if (i > 0 && gradients.defined()) gradients.add_(poses[i].gradients);
      if (i > 0 && static_gradients.defined()) static_gradients.add_(poses[i].static_gradients);
      result.loss += poses[i].result.loss / count;
      result.squared_error += poses[i].result.squared_error;
      result.foreground += poses[i].result.foreground;
    }
    for (torch::Tensor* part : {&gradients, &static_gradients}) {
      if (count > 1 && part->defined()) part->mul_(1.0 / count);
    }
    result.loss += add_penalty(person.model().statics(), static_gradients);
    if (adapter_ && gradients.defined()) gradients = adapter_->gradients(gradients);
    if (!step(person, gradients, static_gradients, rate))
      fail(person, samples[0], "a gradient is not finite");
    last.add(state_.stages.optimiser);
    return result;
  }

  // Of the static values' mean square: returns its share of the loss.
  double add_penalty(const StaticMap& statics, torch::Tensor& static_gradients) const {
    if (settings_.static_penalty == 0 || !static_gradients.defined()) return 0;
    const torch::Tensor& values = statics.values;
    const double weight = settings_.static_penalty / static_cast<double>(values.numel());
    static_gradients.add_(values, 2 * weight);
    return weight * values.square().sum().item<double>();
  }

  // Both parts or, where a gradient is not finite, none.
  bool step(Person& person, torch::Tensor& gradients, torch::Tensor& static_gradients,
            double rate) {
    double squared = 0;
    for (const torch::Tensor* part : {&gradients, &static_gradients}) {
      if (part->defined()) squared += model::squared_norm(*part);
    }
    if (!std::isfinite(squared)) return false;
    gradient_norm_ = std::sqrt(squared);
    const double most = settings_.clip_gradient;
    for (torch::Tensor* part : {&gradients, &static_gradients}) {
      if (part->defined() && most > 0 && gradient_norm_ > most) part->mul_(most / gradient_norm_);
    }
    if (gradients.defined() && !step_network(gradients, rate)) return false;
    const double static_rate = rate * settings_.static_learning_rate / settings_.schedule.peak;
    return !static_gradients.defined() || static_rate == 0 ||
           person.static_optimiser.step(person.model().statics().values, static_gradients,
                                        static_rate);
  }

  // gradients: of its weights or of its adapter's factors.
  bool step_network(const torch::Tensor& gradients, double rate) {
    if (adapter_ == nullptr) return optimiser_.step(model().unet().weights(), gradients, rate);
    if (!optimiser_.step(adapter_->factors(), gradients, rate)) return false;
    adapter_->fold_into(model().unet().weights());
    return true;
  }

  // Stages of lane 0; the others' run beside them.
  void add_stages(const StageSeconds& stages) {
    StageSeconds& sum = state_.stages;
    sum.unet_forward += stages.unet_forward, sum.unet_backward += stages.unet_backward;
    sum.compose += stages.compose;
    sum.splat_forward += stages.splat_forward, sum.splat_backward += stages.splat_backward;
    sum.loss += stages.loss, sum.perceptual += stages.perceptual;
  }

  // fade: what is left of the stand-off's weight.
  PoseResult pose_iteration(const Sample& sample, Person& person, unsigned lane,
                            double fade) const {
    StageClock clock;
    PoseResult pose;
    AvatarModel& model = person.model(lane);
    torch::Tensor output;
    if (network_learns()) {
      model.unet().zero_gradients();
      output = model.unet().forward(sample.posed.input);
    } else if (model.has_network()) {
      output = person.outputs.get(sample.frame, [&] {
        const torch::NoGradGuard no_gradient;
        return model.unet().forward(sample.posed.input);
      });
    }
    clock.add(pose.stages.unet_forward);
    const torch::Tensor head = model.compose(output).requires_grad_();
    clock.add(pose.stages.compose);
    if (sample.number / settings_.poses_per_iteration < settings_.warmup_iterations) {
      const torch::Tensor loss = reference_loss(head, person.reference);
      pose.result.loss = loss.item<double>();
      loss.backward();
      clock.add(pose.stages.loss);
    } else {
      pose.result = image_iteration(sample, head, model, fade, clock, pose.stages);
    }
    const PartGradients parts = model.compose_backward(output, head.grad());
    pose.static_gradients = parts.statics;
    clock.add(pose.stages.compose);
    if (network_learns()) {
      output.backward(parts.network);
      pose.gradients = model.unet().gradients();
    }
    clock.add(pose.stages.unet_backward);
    return pose;
  }

  // The graph is cut at the network's output, the head and the pictures, so that each part's
  // backward pass can be timed and the views of a pose can share one run of the network. Gradients
  // are those of the mean loss of the views; they are added to the head's, a leaf.
  IterationResult image_iteration(const Sample& sample, const torch::Tensor& head,
                                  AvatarModel& model, double fade, StageClock& clock,
                                  StageSeconds& stages) const {
    std::vector<double> pulls(
        fade * settings_.standoff_weight > 0 ? model.body().texel_position_m.size() : 0);
    const double share = 1.0 / static_cast<double>(sample.views.size());
    IterationResult result;
    for (const SampleView& view : sample.views) {
      const torch::Tensor image =
          model.renderer().render(head, model.head_frame(sample.posed), view.view);
      clock.add(stages.splat_forward);
      const torch::Tensor image_leaf = image.detach().requires_grad_();
      model::LossTerms terms;
      const torch::Tensor loss = model::image_loss(image_leaf, view.target, sample.background,
                                                   {.ssim_weight = settings_.ssim_weight,
                                                    .mask_weight = settings_.mask_weight,
                                                    .threads = model.settings().threads},
                                                   &terms);
      (loss * (view.loss_scale * share)).backward();
      clock.add(stages.loss);
      if (request_.perceptual != nullptr) {
        result.loss += add_perceptual(sample, view, image_leaf, share);
        clock.add(stages.perceptual);
      }
      if (!pulls.empty())
        result.loss += add_pulls(model, view, image_leaf, fade * view.loss_scale * share, pulls);
      clock.add(stages.loss);
      image.backward(image_leaf.grad());
      clock.add(stages.splat_backward);
      result.loss += terms.total * view.loss_scale * share;
      result.squared_error += terms.squared_error;
      result.foreground += terms.foreground;
    }
    if (!pulls.empty())
      add_offset_gradient(model.head_frame(sample.posed), pulls,
                          head.grad().mutable_data_ptr<float>());
    return result;
  }

  // Adds the perceptual term's gradient to the picture's; returns its share of the loss. The window
  // is as large in a whole image: no loss_scale.
  double add_perceptual(const Sample& sample, const SampleView& view, const torch::Tensor& image,
                        double share) const {
    const torch::Tensor distance = model::perceptual_loss(image, view.target, sample.background,
                                                          view.window, *request_.perceptual);
    const double weight = share * settings_.perceptual.weight;
    if (distance.requires_grad()) (distance * weight).backward();
    return weight * distance.item<double>();
  }

  // Of the picture that was rendered last; its share of the loss.
  double add_pulls(AvatarModel& model, const SampleView& view, const torch::Tensor& image,
                   double scale, std::vector<double>& pulls) const {
    const StandoffView seen{.camera = &view.view.camera,
                            .crop = view.view.crop,
                            .alpha = image[3].const_data_ptr<float>(),
                            .mask = view.target[3].const_data_ptr<float>()};
    const StandoffOptions options{.weight = settings_.standoff_weight,
                                  .unit_m = settings_.decoding.offset_scale_m};
    return scale *
           standoff_loss(seen, model.renderer().gaussians().position_m, options, scale, pulls);
  }

  [[noreturn]] void fail(const Person& person, const Sample& sample, const char* what) const {
    throw InputError(run_.path + ": iteration " + std::to_string(state_.iteration) + " (" +
                     person.data().image_path(sample.frame, sample.views.front().camera) +
                     "): " + what + "; the last checkpoint is kept");
  }

  void record(const IterationResult& result, double rate) {
    means_.loss += result.loss;
    means_.squared_error += result.squared_error;
    means_.foreground += result.foreground;
    ++means_.count;
    const double weight = std::max(kRunningMean, 1.0 / static_cast<double>(++shown_count_));
    shown_loss_ += weight * (result.loss - shown_loss_);
    if (result.foreground > 0) {
      const double mse = result.squared_error / (3.0 * static_cast<double>(result.foreground));
      shown_mse_ = shown_mse_ < 0 ? mse : shown_mse_ + weight * (mse - shown_mse_);
    }
    if (state_.iteration % kLogPeriod == 0) {
      rows_.push_back({state_.iteration, state_.seconds, rate,
                       means_.loss / static_cast<double>(means_.count), means_.psnr_db()});
      means_ = {};
    }
  }

  double shown_psnr() const { return shown_mse_ > 0 ? -10 * std::log10(shown_mse_) : 0; }

  void save(const char* status) {
    save_checkpoint(run_, state_, parts(), optimisers(), further());
    save_log(run_, rows_);
    add_progress(description_, status);
    if (people_.size() == 1) {
      save_weights(run_, model().parts());
    } else {
      for (const auto& person : people_) {
        save_weights(person->run, person->model().parts());
        add_progress(person->description, status);
        write_json(person->run.run_json(), person->description);
      }
      StaticMap mean = mean_statics(people_);
      save_weights(run_, {.unet = &model().unet(), .statics = &mean});
    }
    write_json(run_.run_json(), description_);
  }

  void add_progress(nlohmann::json& description, const char* status) const {
    const double iterations = static_cast<double>(std::max<uint64_t>(1, state_.iteration));
    const StageSeconds& s = state_.stages;
    description["status"] = status;
    description["iterations"] = state_.iteration;
    description["train_seconds"] = state_.seconds;
    description["iterations_per_second"] =
        state_.seconds > 0 ? static_cast<double>(state_.iteration) / state_.seconds : 0.0;
    description["breakdown_ms"] = {{"data", 1e3 * s.data / iterations},
                                   {"unet_forward", 1e3 * s.unet_forward / iterations},
                                   {"compose", 1e3 * s.compose / iterations},
                                   {"splat_forward", 1e3 * s.splat_forward / iterations},
                                   {"loss", 1e3 * s.loss / iterations},
                                   {"perceptual", 1e3 * s.perceptual / iterations},
                                   {"splat_backward", 1e3 * s.splat_backward / iterations},
                                   {"unet_backward", 1e3 * s.unet_backward / iterations},
                                   {"optimiser", 1e3 * s.optimiser / iterations}};
    description["running"] = {
        {"loss", shown_loss_}, {"psnr_db", shown_psnr()}, {"gradient_norm", gradient_norm_}};
    description["updated"] = utc_now();
  }

  const TrainRequest& request_;
  TrainSettings settings_;
  RunDirectory run_;
  nlohmann::json description_;
  People people_;
  Lanes lanes_{lane_count(settings_),
               [count = network_threads(settings_)] { model::use_threads(count); }};
  std::unique_ptr<model::NetworkAdapter> adapter_;  // null unless settings ask for one
  model::Optimiser optimiser_;                      // of what learns of the network
  TrainingState state_;
  std::vector<LogRow> rows_;
  Means means_;
  double shown_loss_ = 0, shown_mse_ = -1;
  double gradient_norm_ = 0;  // of the last step, before clipping
  uint64_t shown_count_ = 0;
};

}  // namespace

RunDescription read_run(const RunDirectory& run) {
  const std::string path = run.run_json();
  if (!std::filesystem::exists(path))
    throw InputError(run.path + ": no run.json; is this a folder of figurine-train avatar?");
  RunDescription description;
  description.json = read_json(path);
  try {
    const nlohmann::json& json = description.json;
    if (const int format = json.at("format").get<int>(); format != kRunFormat) {
      throw InputError(path + ": format: is " + std::to_string(format) + ", this build reads " +
                       std::to_string(kRunFormat));
    }
    description.data = json.at("data").at("path").get<std::string>();
    description.body = json.at("body").at("path").get<std::string>();
    description.body_hash = json.at("body").at("hash").get<std::string>();
    description.shape = json.at("shape").get<std::vector<float>>();
    description.settings = settings_from_json(json.at("settings"), path);
    const nlohmann::json people = json.value("people", nlohmann::json::array());
    for (size_t p = 1; p < people.size(); ++p)
      description.more_data.push_back(people[p].at("data").get<std::string>());
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path + ": " + error.what());
  }
  return description;
}

namespace {

// Everybody's folder, without a slash at its end: its name is the person's.
std::vector<std::string> everybody(const TrainRequest& request) {
  std::vector<std::string> folders{request.data};
  folders.insert(folders.end(), request.more_data.begin(), request.more_data.end());
  for (std::string& folder : folders) {
    while (folder.size() > 1 && folder.ends_with('/')) folder.pop_back();
  }
  return folders;
}

// The people's runs inside the training's folder, called as the data folders are. Captures of
// several seeds have people of one name: the second is NAME_2.
std::vector<std::string> run_names(const std::vector<std::string>& data) {
  std::vector<std::string> names;
  for (const std::string& path : data) {
    const std::string name = std::filesystem::path(path).filename().string();
    std::string unique = name;
    for (int i = 2; std::find(names.begin(), names.end(), unique) != names.end(); ++i)
      unique = name + "_" + std::to_string(i);
    names.push_back(unique);
  }
  return names;
}

void check_people(const std::vector<std::string>& data, const TrainSettings& settings) {
  if (data.size() > 1 && (!settings.network || settings.static_grids.empty()))
    throw InputError("settings: static_grids: people who share a network need values of their own");
}

nlohmann::json list_people(const std::vector<std::string>& data) {
  nlohmann::json people = nlohmann::json::array();
  const std::vector<std::string> names = run_names(data);
  for (size_t p = 0; p < data.size(); ++p) people.push_back({{"data", data[p]}, {"run", names[p]}});
  return people;
}

// Reads run.json: what the run was begun with must be what it goes on with.
nlohmann::json take_up(const TrainRequest& request, const std::string& body_hash,
                       TrainSettings& settings) {
  RunDescription old = read_run({request.run});
  if (old.body_hash != body_hash) {
    throw InputError(request.run + ": was trained on body " + old.body_hash + ", " + request.body +
                     " is " + body_hash);
  }
  if (old.json.contains("one_of"))
    throw InputError(request.run + ": is one of several people of a training; go on with that");
  if (old.more_data.size() != request.more_data.size()) {
    throw InputError(request.run + ": was begun with " + std::to_string(1 + old.more_data.size()) +
                     " people, not " + std::to_string(1 + request.more_data.size()));
  }
  settings = old.settings;
  settings.threads = request.settings.threads;
  return std::move(old.json);
}

}  // namespace

TrainResult train_avatar(const TrainRequest& request) {
  const RunDirectory run{request.run};
  TrainSettings settings = request.settings;
  nlohmann::json description;
  std::optional<ports::FolderLock> lock;  // of two trainings in one folder the slower one would win
  const auto lock_run = [&] {
    lock.emplace(value_or_throw(ports::FolderLock::acquire(request.run), "cannot train"));
  };
  if (std::filesystem::is_directory(request.run)) lock_run();
  const bool exists = std::filesystem::exists(run.run_json());
  if (exists && !request.resume)
    throw InputError(request.run + ": holds a run already; --resume goes on with it");
  if (!exists && request.resume)
    throw InputError(request.run + ": no run to resume (run.json is missing)");
  const PackageFile body = open_package(request.body, PackageKind::kBody);
  const std::string body_hash = format_hash(body.package.content_hash());
  if (exists) {
    description = take_up(request, body_hash, settings);
    if (description.value("status", "") == "finished") {
      return {.state = {.iteration = description.value("iterations", uint64_t{0}),
                        .seconds = description.value("train_seconds", 0.0),
                        .stages = {}},
              .was_finished = true};
    }
  }
  const std::vector<std::string> paths = everybody(request);
  check_people(paths, settings);
  if (settings.perceptual.file.empty() != (request.perceptual == nullptr))
    throw InputError(request.run + ": perceptual: its network and its settings go together");
  std::vector<std::unique_ptr<dataset::Dataset>> data;
  const dataset::ModelOrigin origin = dataset::model_origin(body.package, request.body);
  for (const std::string& path : paths) {
    data.push_back(std::make_unique<dataset::Dataset>(dataset::Dataset::open(
        path, {.body = &body.package.body(), .body_hash = body_hash, .origin = origin})));
    data.back()->leave_out_blank_cameras();
    if (request.quiet) continue;
    for (const std::string& remark : data.back()->remarks())
      std::fprintf(stderr, "figurine-train: %s: %s\n", path.c_str(), remark.c_str());
  }
  const auto describe = [&](size_t person) {
    return describe_run({.command = request.command,
                         .body_path = request.body,
                         .body = &body,
                         .data = data[person].get()},
                        settings);
  };
  if (!exists) {
    check_parts(settings, "settings");
    description = describe(0);
    description.update(request.notes);
    if (paths.size() > 1) description["people"] = list_people(paths);
    make_folder(request.run);
    if (!lock) lock_run();
  }
  model::use_threads(network_threads(settings));
  model::keep_freed_memory();
  People people;
  for (size_t p = 0; p < paths.size(); ++p) {
    RunDirectory own = run;
    nlohmann::json said;
    if (paths.size() > 1) {
      own.path += "/" + run_names(paths)[p];
      said = exists ? read_json(own.run_json()) : describe(p);
      said["one_of"] = paths.size();
    }
    people.push_back(std::make_unique<Person>(body.package.body(), *data[p], settings, own, said));
  }
  return Trainer(request, settings, std::move(people), std::move(description)).run();
}

}  // namespace figurine::train
