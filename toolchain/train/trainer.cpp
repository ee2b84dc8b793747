#include "toolchain/train/trainer.h"

#include <chrono>
#include <cmath>
#include <filesystem>

#include "toolchain/dataset/dataset.h"
#include "toolchain/error.h"
#include "toolchain/model/allocator.h"
#include "toolchain/model/loss.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/lanes.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/reference_gaussians.h"
#include "toolchain/train/sample_feed.h"
#include "toolchain/train/standoff.h"

namespace figurine::train {

namespace {

constexpr int kRunFormat = 1;
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

// Never more lanes than threads: poses beyond them wait for their turn.
unsigned lane_count(const TrainSettings& settings) {
  return std::min(settings.poses_per_iteration, settings.threads);
}

// LibTorch's number of threads inside an operation belongs to the thread that calls it.
void use_lane_threads(const TrainSettings& settings) {
  at::set_num_threads(static_cast<int>(settings.threads / lane_count(settings)));
}

std::vector<model::ParameterGroup> network_groups(const AvatarModel& model) {
  if (!model.has_network()) return {};
  return model.settings().optimiser == OptimiserKind::kMuon
             ? model.unet().muon_groups()
             : model::adamw_group(model.unet().parameter_count());
}

model::OptimiserOptions adamw_options(const TrainSettings& settings, double weight_decay) {
  return {.beta1 = settings.beta1,
          .beta2 = settings.beta2,
          .epsilon = settings.epsilon,
          .weight_decay = weight_decay};
}

class Trainer {
 public:
  Trainer(const TrainRequest& request, const TrainSettings& settings, const PackageFile& body,
          const dataset::Dataset& data, nlohmann::json description)
      : request_(request),
        settings_(settings),
        run_{request.run},
        data_(data),
        description_(std::move(description)),
        model_(body.package.body(), data.shape(), lane_settings(), settings.bf16),
        optimiser_(network_groups(model_), adamw_options(settings, settings.weight_decay)),
        static_optimiser_(
            model::adamw_group(static_cast<uint64_t>(model_.statics().values.numel())),
            adamw_options(settings, 0)) {
    for (unsigned lane = 1; lane < lane_count(settings_); ++lane) {
      replicas_.push_back(std::make_unique<AvatarModel>(body.package.body(), data.shape(),
                                                        lane_settings(), settings.bf16));
      replicas_.back()->share_parts(model_);
    }
    if (request.fake_quantisation == nullptr) return;
    for (unsigned lane = 0; lane < lane_count(settings_); ++lane)
      model_of(lane).unet().set_fake_quantisation(request.fake_quantisation);
  }

  TrainResult run() {
    start();
    SampleFeed feed(data_, model_, state_.iteration * settings_.poses_per_iteration);
    Progress progress(std::filesystem::path(request_.data).filename().string(), request_.quiet);
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
      const IterationResult result = iterate(feed, rate);
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
  // A lane's renderer and loss have that lane's share of the threads.
  TrainSettings lane_settings() const {
    TrainSettings settings = settings_;
    settings.threads /= lane_count(settings_);
    return settings;
  }

  PartOptimisers optimisers() {
    return {.unet = model_.has_network() ? &optimiser_ : nullptr,
            .statics = model_.statics().empty() ? nullptr : &static_optimiser_};
  }

  // What a package in fixed point holds of the static values.
  void round_statics() {
    const model::HeadLayout layout = head_layout(settings_);
    take_static_part(RoundedMap(model_.statics(), layout).view(), layout, model_.statics());
  }

  AvatarModel& model_of(unsigned lane) { return lane == 0 ? model_ : *replicas_[lane - 1]; }

  void start() {
    if (request_.resume && std::filesystem::exists(run_.checkpoint())) {
      state_ = load_checkpoint(run_, model_.parts(), optimisers());
      rows_ = load_log(run_, state_.iteration);
    } else {
      if (!settings_.init.empty()) load_initial_weights(settings_.init, model_.parts());
      if (request_.fake_quantisation != nullptr) round_statics();
      if (SmallestExtentMap* extents = model_.smallest_extents())
        round_extents(measure_extents(data_, model_), data_.directory(), *extents);
      description_["parts"] = describe_parts(model_);
      write_json(run_.run_json(), description_);
    }
    if (state_.iteration < settings_.warmup_iterations) reference_ = reference_head(data_, model_);
  }

  IterationResult iterate(SampleFeed& feed, double rate) {
    StageClock clock;
    const uint32_t count = settings_.poses_per_iteration, lanes = lane_count(settings_);
    std::vector<Sample> samples;
    for (uint32_t i = 0; i < count; ++i) samples.push_back(feed.next());
    clock.add(state_.stages.data);
    std::vector<PoseResult> poses(count);
    const double fade =
        standoff_fade(train::progress(settings_.schedule.budget, state_.iteration, state_.seconds));
    lanes_.run([&](unsigned lane) {
      for (uint32_t i = lane; i < count; i += lanes)
        poses[i] = pose_iteration(samples[i], model_of(lane), fade);
    });
    for (size_t i = 0; i < count; i += lanes) add_stages(poses[i].stages);
    StageClock last;
    IterationResult result;
    // In the order of the poses, whatever thread they ran on.
    torch::Tensor gradients = poses[0].gradients, static_gradients = poses[0].static_gradients;
    for (uint32_t i = 0; i < count; ++i) {
      if (!std::isfinite(poses[i].result.loss)) fail(samples[i], "the loss is not finite");
      if (i > 0 && gradients.defined()) gradients.add_(poses[i].gradients);
      if (i > 0 && static_gradients.defined()) static_gradients.add_(poses[i].static_gradients);
      result.loss += poses[i].result.loss / count;
      result.squared_error += poses[i].result.squared_error;
      result.foreground += poses[i].result.foreground;
    }
    for (torch::Tensor* part : {&gradients, &static_gradients}) {
      if (count > 1 && part->defined()) part->mul_(1.0 / count);
    }
    result.loss += add_penalty(static_gradients);
    if (!step(gradients, static_gradients, rate)) fail(samples[0], "a gradient is not finite");
    last.add(state_.stages.optimiser);
    return result;
  }

  // Of the static values' mean square: returns its share of the loss.
  double add_penalty(torch::Tensor& static_gradients) const {
    if (settings_.static_penalty == 0 || !static_gradients.defined()) return 0;
    const torch::Tensor& values = model_.statics().values;
    const double weight = settings_.static_penalty / static_cast<double>(values.numel());
    static_gradients.add_(values, 2 * weight);
    return weight * values.square().sum().item<double>();
  }

  // Both parts or, where a gradient is not finite, none.
  bool step(torch::Tensor& gradients, torch::Tensor& static_gradients, double rate) {
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
    if (gradients.defined() && !optimiser_.step(model_.unet().weights(), gradients, rate))
      return false;
    const double static_rate = rate * settings_.static_learning_rate / settings_.schedule.peak;
    return !static_gradients.defined() || static_rate == 0 ||
           static_optimiser_.step(model_.statics().values, static_gradients, static_rate);
  }

  // Stages of lane 0; the others' run beside them.
  void add_stages(const StageSeconds& stages) {
    StageSeconds& sum = state_.stages;
    sum.unet_forward += stages.unet_forward, sum.unet_backward += stages.unet_backward;
    sum.compose += stages.compose;
    sum.splat_forward += stages.splat_forward, sum.splat_backward += stages.splat_backward;
    sum.loss += stages.loss;
  }

  // fade: what is left of the stand-off's weight.
  PoseResult pose_iteration(const Sample& sample, AvatarModel& model, double fade) const {
    StageClock clock;
    PoseResult pose;
    torch::Tensor output;
    if (model.has_network()) {
      model.unet().zero_gradients();
      output = model.unet().forward(sample.posed.input);
    }
    clock.add(pose.stages.unet_forward);
    const torch::Tensor head = model.compose(output).requires_grad_();
    clock.add(pose.stages.compose);
    if (sample.number / settings_.poses_per_iteration < settings_.warmup_iterations) {
      const torch::Tensor loss = reference_loss(head, reference_);
      pose.result.loss = loss.item<double>();
      loss.backward();
      clock.add(pose.stages.loss);
    } else {
      pose.result = image_iteration(sample, head, model, fade, clock, pose.stages);
    }
    const PartGradients parts = model.compose_backward(output, head.grad());
    pose.static_gradients = parts.statics;
    clock.add(pose.stages.compose);
    if (model.has_network()) {
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

  [[noreturn]] void fail(const Sample& sample, const char* what) const {
    throw InputError(run_.path + ": iteration " +
                     std::to_string(sample.number / settings_.poses_per_iteration) + " (" +
                     data_.image_path(sample.frame, sample.views.front().camera) + "): " + what +
                     "; the last checkpoint is kept");
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
    save_checkpoint(run_, state_, model_.parts(), optimisers());
    save_weights(run_, model_.parts());
    save_log(run_, rows_);
    const double iterations = static_cast<double>(std::max<uint64_t>(1, state_.iteration));
    const StageSeconds& s = state_.stages;
    description_["status"] = status;
    description_["iterations"] = state_.iteration;
    description_["train_seconds"] = state_.seconds;
    description_["iterations_per_second"] =
        state_.seconds > 0 ? static_cast<double>(state_.iteration) / state_.seconds : 0.0;
    description_["breakdown_ms"] = {{"data", 1e3 * s.data / iterations},
                                    {"unet_forward", 1e3 * s.unet_forward / iterations},
                                    {"compose", 1e3 * s.compose / iterations},
                                    {"splat_forward", 1e3 * s.splat_forward / iterations},
                                    {"loss", 1e3 * s.loss / iterations},
                                    {"splat_backward", 1e3 * s.splat_backward / iterations},
                                    {"unet_backward", 1e3 * s.unet_backward / iterations},
                                    {"optimiser", 1e3 * s.optimiser / iterations}};
    description_["running"] = {
        {"loss", shown_loss_}, {"psnr_db", shown_psnr()}, {"gradient_norm", gradient_norm_}};
    description_["updated"] = utc_now();
    write_json(run_.run_json(), description_);
  }

  const TrainRequest& request_;
  TrainSettings settings_;
  RunDirectory run_;
  const dataset::Dataset& data_;
  nlohmann::json description_;
  AvatarModel model_;
  std::vector<std::unique_ptr<AvatarModel>> replicas_;  // of lanes 1..; their weights are model_'s
  Lanes lanes_{lane_count(settings_), [settings = settings_] { use_lane_threads(settings); }};
  model::Optimiser optimiser_, static_optimiser_;
  torch::Tensor reference_;
  TrainingState state_;
  std::vector<LogRow> rows_;
  Means means_;
  double shown_loss_ = 0, shown_mse_ = -1;
  double gradient_norm_ = 0;  // of the last step, before clipping
  uint64_t shown_count_ = 0;
};

nlohmann::json describe(const TrainRequest& request, const TrainSettings& settings,
                        const PackageFile& body, const dataset::Dataset& data) {
  uint32_t held_out_cameras = 0;
  for (const dataset::CaptureCamera& camera : data.cameras()) held_out_cameras += camera.held_out;
  uint32_t frames[3] = {0, 0, 0};
  for (const dataset::CaptureFrame& frame : data.frames()) ++frames[static_cast<int>(frame.split)];
  const Network network = make_network(settings);
  const uint64_t macs =
      settings.network
          ? count_macs(network, value_or_throw(infer_shapes(network, false), settings.preset))
          : 0;
  return {{"format", kRunFormat},
          {"status", "running"},
          {"tool", "figurine-train " FIGURINE_VERSION},
          {"command", request.command},
          {"created", utc_now()},
          {"commit", current_commit()},
          {"machine", describe_machine()},
          {"settings", to_json(settings)},
          {"macs_per_frame", macs},
          {"body",
           {{"path", request.body},
            {"name", body.package.body().name},
            {"hash", format_hash(body.package.content_hash())}}},
          {"shape", data.shape()},
          {"data",
           {{"path", request.data},
            {"seed", data.seed()},
            {"sources", data.sources()},
            {"cameras", data.cameras().size() - held_out_cameras},
            {"held_out_cameras", held_out_cameras},
            {"training_frames", frames[0]},
            {"held_out_frames_interleaved", frames[1]},
            {"held_out_frames_block", frames[2]}}}};
}

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
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path + ": " + error.what());
  }
  return description;
}

TrainResult train_avatar(const TrainRequest& request) {
  const RunDirectory run{request.run};
  TrainSettings settings = request.settings;
  nlohmann::json description;
  const bool exists = std::filesystem::exists(run.run_json());
  if (exists && !request.resume)
    throw InputError(request.run + ": holds a run already; --resume goes on with it");
  if (!exists && request.resume)
    throw InputError(request.run + ": no run to resume (run.json is missing)");
  const PackageFile body = open_package(request.body, PackageKind::kBody);
  const std::string body_hash = format_hash(body.package.content_hash());
  if (exists) {
    RunDescription old = read_run(run);
    if (old.body_hash != body_hash) {
      throw InputError(request.run + ": was trained on body " + old.body_hash + ", " +
                       request.body + " is " + body_hash);
    }
    settings = old.settings;
    settings.threads = request.settings.threads;
    description = std::move(old.json);
    if (description.value("status", "") == "finished") {
      return {.state = {.iteration = description.value("iterations", uint64_t{0}),
                        .seconds = description.value("train_seconds", 0.0),
                        .stages = {}},
              .was_finished = true};
    }
  }
  const dataset::Dataset data =
      dataset::Dataset::open(request.data, {.body = &body.package.body(), .body_hash = body_hash});
  if (!exists) {
    check_parts(settings, "settings");
    description = describe(request, settings, body, data);
    description.update(request.notes);
    std::error_code error;
    std::filesystem::create_directories(request.run, error);
    if (error) throw InputError(request.run + ": cannot be created: " + error.message());
  }
  use_lane_threads(settings);
  model::keep_freed_memory();
  return Trainer(request, settings, body, data, std::move(description)).run();
}

}  // namespace figurine::train
