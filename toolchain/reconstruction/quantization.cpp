#include "toolchain/reconstruction/quantization.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/pictures/pose_sequence.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/progress.h"

namespace figurine::reconstruction {

using measure::foreground_error;
using measure::Picture;
using measure::quantise_picture;
using measure::SquaredError;
using pictures::change_error;
using pictures::FloatPictures;
using pictures::frozen_error;
using pictures::pose_frame;
using pictures::PosedFrame;
using pictures::PoseSequence;
using pictures::render_picture;
using pictures::render_sequence;
using pictures::slow_motion;
using pictures::trembling_pose;
using pictures::true_picture;

namespace {

using nlohmann::json;
using quantize::CalibrationOptions;
using quantize::RangeMethod;
using quantize::WeightRange;

constexpr uint32_t kSlowKeys = 6, kSlower = 8, kTremblingFrames = 24;
constexpr size_t kWorstPoses = 5;

// What the UNet is set to for one row.
struct Variant {
  torch::Tensor weights;                                    // [P]
  std::shared_ptr<const model::FakeQuantisation> rounding;  // null: float
  bool round_statics = false;                               // as a package holds them
};

struct View {
  size_t camera = 0;
  Picture truth, plain;  // the capture's, the float network's
};

struct LookedAtPose {
  size_t frame = 0;
  train::PosedBody posed;
  std::vector<View> views;
};

struct Score {
  SquaredError truth, plain;  // against the capture, against the float network
  std::vector<SquaredError> pose_truth, pose_plain;  // the same for each pose
};

// What all rows are measured on: pictures of held-out poses and views with their truth, and
// sequences, kept in memory.
class Laboratory {
 public:
  Laboratory(train::TrainedAvatar& avatar, const QuantizationOptions& options);

  train::AvatarModel& model() { return avatar_.model(); }
  const Variant& plain() const { return plain_; }
  const std::vector<LookedAtPose>& poses() const { return poses_; }
  uint32_t frame_number(size_t pose) const {
    return avatar_.data().frames()[poses_[pose].frame].number;
  }
  size_t picture_count() const;

  void use(const Variant& variant);
  Score score(const Variant& variant);
  Score score_of_plain() const;
  // {"slow_motion_db", "trembling_pose_db"}
  json score_sequences(const Variant& variant);
  json frozen_sequences() const;

 private:
  void choose_pictures(const QuantizationOptions& options);
  void choose_sequences(const QuantizationOptions& options);
  void look(size_t frame, const std::vector<size_t>& cameras);

  train::TrainedAvatar& avatar_;
  Variant plain_;
  torch::Tensor statics_, rounded_statics_;
  std::vector<LookedAtPose> poses_;
  std::vector<PoseSequence> sequences_;
  std::vector<FloatPictures> plain_sequences_;
};

Laboratory::Laboratory(train::TrainedAvatar& avatar, const QuantizationOptions& options)
    : avatar_(avatar) {
  plain_.weights = model().unet().weights().detach().clone();
  train::StaticMap& statics = model().statics();
  statics_ = statics.values.clone();
  const model::HeadLayout layout = train::head_layout(model().settings());
  train::take_static_part(train::RoundedMap(statics, layout).view(), layout, statics);
  rounded_statics_ = statics.values.clone();
  statics.values.copy_(statics_);
  choose_pictures(options);
  choose_sequences(options);
  for (const PoseSequence& sequence : sequences_)
    plain_sequences_.push_back(render_sequence(avatar_, sequence));
}

std::vector<size_t> spread(const std::vector<size_t>& all, size_t count) {
  std::vector<size_t> chosen;
  count = std::min(count, all.size());
  for (size_t i = 0; i < count; ++i) chosen.push_back(all[i * all.size() / count]);
  return chosen;
}

void Laboratory::choose_pictures(const QuantizationOptions& options) {
  const dataset::Dataset& data = avatar_.data();
  std::vector<size_t> cameras, held_out_cameras, held_out_frames, training_frames;
  for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
    if (data.cameras()[camera].framing != dataset::Framing::kBody) continue;
    cameras.push_back(camera);
    if (data.cameras()[camera].held_out) held_out_cameras.push_back(camera);
  }
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    (data.frames()[frame].split == dataset::FrameSplit::kTrain ? training_frames : held_out_frames)
        .push_back(frame);
  }
  for (size_t frame : held_out_frames) look(frame, spread(cameras, options.views_per_pose));
  for (size_t frame :
       spread(training_frames, held_out_cameras.empty() ? 0 : options.training_poses))
    look(frame, held_out_cameras);
  if (poses_.empty())
    throw InputError(data.directory() + ": nothing is held out, so there is nothing to evaluate");
}

void Laboratory::look(size_t frame, const std::vector<size_t>& cameras) {
  PosedFrame posed = pose_frame(avatar_, frame);
  LookedAtPose& pose = poses_.emplace_back(LookedAtPose{frame, {}, {}});
  for (size_t camera : cameras) {
    pose.views.push_back({camera, true_picture(avatar_.data(), frame, camera),
                          render_picture(avatar_, posed, avatar_.data().cameras()[camera].camera)});
  }
  pose.posed = std::move(posed.posed);
}

void Laboratory::choose_sequences(const QuantizationOptions& options) {
  const dataset::Dataset& data = avatar_.data();
  const Camera& camera = data.cameras().front().camera;
  std::vector<train::OwnedPose> keys;
  if (options.motion.empty()) {
    for (size_t frame = 0; frame < data.frames().size() && keys.size() < kSlowKeys; ++frame) {
      keys.push_back(model().from_capture(data.frames()[frame]));
    }
  } else {
    const train::PackageFile file = train::open_package(options.motion, PackageKind::kMotion);
    const Motion& motion = file.package.motion();
    if (motion.joint_names.size() != model().body().joint_count())
      throw InputError(options.motion + ": joints are not the body's");
    for (uint32_t frame = 0; frame < std::min(motion.frame_count, kSlowKeys); ++frame) {
      const PoseView pose = motion.pose(frame);
      keys.push_back({pose.root_translation_m, {pose.rotations.begin(), pose.rotations.end()}});
    }
  }
  if (keys.size() < 2) throw InputError("a slow motion needs two poses");
  const train::OwnedPose still = model().from_capture(data.frames()[poses_.front().frame]);
  sequences_ = {slow_motion(keys, kSlower, camera),
                trembling_pose(still, kTremblingFrames, camera)};
}

size_t Laboratory::picture_count() const {
  size_t count = 0;
  for (const LookedAtPose& pose : poses_) count += pose.views.size();
  return count;
}

void Laboratory::use(const Variant& variant) {
  torch::NoGradGuard no_gradient;
  model().unet().weights().copy_(variant.weights);
  model().unet().set_fake_quantisation(variant.rounding);
  model().statics().values.copy_(variant.round_statics ? rounded_statics_ : statics_);
}

Score Laboratory::score(const Variant& variant) {
  use(variant);
  Score score;
  for (const LookedAtPose& pose : poses_) {
    const torch::Tensor head = model().evaluate(pose.posed);
    SquaredError truth, plain;
    for (const View& view : pose.views) {
      const Camera& camera = avatar_.data().cameras()[view.camera].camera;
      const Picture picture = quantise_picture(camera.width_px, camera.height_px,
                                               model().render_rgba(head, pose.posed, camera));
      truth.add(foreground_error(picture, view.truth));
      plain.add(foreground_error(picture, view.plain));
    }
    score.truth.add(truth), score.plain.add(plain);
    score.pose_truth.push_back(truth), score.pose_plain.push_back(plain);
  }
  use(plain_);
  return score;
}

Score Laboratory::score_of_plain() const {
  Score score;
  for (const LookedAtPose& pose : poses_) {
    SquaredError truth;
    for (const View& view : pose.views) truth.add(foreground_error(view.plain, view.truth));
    score.truth.add(truth);
    score.pose_truth.push_back(truth);
  }
  return score;
}

json Laboratory::score_sequences(const Variant& variant) {
  use(variant);
  json result;
  for (size_t i = 0; i < sequences_.size(); ++i) {
    result[sequences_[i].name + "_db"] = finite(
        change_error(render_sequence(avatar_, sequences_[i]), plain_sequences_[i]).psnr_db());
  }
  use(plain_);
  return result;
}

json Laboratory::frozen_sequences() const {
  json result;
  for (size_t i = 0; i < sequences_.size(); ++i)
    result[sequences_[i].name + "_db"] = finite(frozen_error(plain_sequences_[i]).psnr_db());
  return result;
}

// What of a network is rounded; everything but the listed parts stays float.
std::shared_ptr<model::FakeQuantisation> nothing_rounded(const quantize::Scales& scales) {
  auto rounding = quantize::fake_quantisation(scales);
  rounding->round_weights.assign(scales.values.size(), false);
  rounding->round_value.assign(scales.values.size(), false);
  return rounding;
}

std::shared_ptr<model::FakeQuantisation> dynamic_ranges(const quantize::Scales& scales) {
  auto rounding = quantize::fake_quantisation(scales);
  rounding->dynamic_ranges = true;
  rounding->round_biases = false;
  return rounding;
}

// An int8 input instead of int16, without the headroom that int16 can afford.
std::shared_ptr<model::FakeQuantisation> int8_input(const quantize::Scales& scales,
                                                    float input_max) {
  auto rounding = quantize::fake_quantisation(scales);
  rounding->input_max = kInt8Max;
  rounding->values[0].scale = input_max / float(kInt8Max);
  return rounding;
}

// The rest stays float.
std::shared_ptr<model::FakeQuantisation> only_input(
    std::shared_ptr<model::FakeQuantisation> rounding) {
  rounding->round_weights.assign(rounding->round_weights.size(), false);
  rounding->round_value.assign(rounding->round_value.size(), false);
  rounding->round_value[0] = true;
  return rounding;
}

std::shared_ptr<model::FakeQuantisation> float_head(const quantize::Scales& scales) {
  auto rounding = quantize::fake_quantisation(scales);
  rounding->round_weights.back() = false;
  return rounding;
}

// All outputs of the head share the coarsest one's scale.
std::shared_ptr<model::FakeQuantisation> head_of_one_scale(const quantize::Scales& scales) {
  auto rounding = quantize::fake_quantisation(scales);
  torch::Tensor& head = rounding->weight_scale.back();
  head = head.max().expand_as(head).contiguous();
  return rounding;
}

struct Row {
  std::string name;
  Variant variant;
  bool sequences = false;  // measured for shimmer, too
};

json describe(const Score& score, const Score& plain) {
  return {{"psnr_db", finite(score.truth.psnr_db())},
          {"psnr_drop_db", finite(plain.truth.psnr_db() - score.truth.psnr_db())},
          {"psnr_to_f32_db", finite(score.plain.psnr_db())}};
}

json worst_poses(const Laboratory& laboratory, const Score& score, const Score& plain) {
  std::vector<size_t> order;
  for (size_t pose = 0; pose < score.pose_plain.size(); ++pose) order.push_back(pose);
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return score.pose_plain[a].mse() > score.pose_plain[b].mse();
  });
  order.resize(std::min(order.size(), kWorstPoses));
  json worst = json::array();
  for (size_t pose : order) {
    worst.push_back({{"frame", laboratory.frame_number(pose)},
                     {"psnr_to_f32_db", finite(score.pose_plain[pose].psnr_db())},
                     {"psnr_drop_db", finite(plain.pose_truth[pose].psnr_db() -
                                             score.pose_truth[pose].psnr_db())}});
  }
  return worst;
}

const char* name_of(LayerOp op) {
  switch (op) {
    case LayerOp::kConv2d:
      return "conv2d";
    case LayerOp::kMaxPool2:
      return "max_pool2";
    case LayerOp::kUpsample2:
      return "upsample2";
    case LayerOp::kConcat:
      return "concat";
  }
  return "?";
}

// One row for every part that rounds: the input, each convolution's weights and output, each
// upsample's output.
std::vector<std::pair<json, Variant>> single_layers(const Network& network,
                                                    const torch::Tensor& weights,
                                                    const quantize::Scales& scales) {
  std::vector<std::pair<json, Variant>> rows;
  rows.push_back(
      {{{"layer", "input"}}, {weights, only_input(quantize::fake_quantisation(scales))}});
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const LayerOp op = network.layers[i].op;
    if (op != LayerOp::kConv2d && op != LayerOp::kUpsample2) continue;
    auto one = nothing_rounded(scales);
    one->round_weights[i] = op == LayerOp::kConv2d;
    if (i + 1 < network.layers.size()) one->round_value[i + 1] = true;
    rows.push_back({{{"layer", i}, {"op", name_of(op)}}, {weights, one}});
  }
  return rows;
}

// How many of each value's elements lie at the ends of int8 (of int16 for the input) over the
// looked-at poses. A ReLU's zeros do not count.
json count_saturation(Laboratory& laboratory, const Variant& variant,
                      const quantize::Scales& scales) {
  laboratory.use(variant);
  const size_t values = scales.values.size();
  std::vector<uint64_t> saturated(values, 0), elements(values, 0);
  for (const LookedAtPose& pose : laboratory.poses()) {
    const std::vector<torch::Tensor> seen =
        laboratory.model().unet().evaluate_values(pose.posed.input);
    for (size_t value = 0; value < values; ++value) {
      const int32_t zero = scales.values[value].zero_point;
      const float high = value == 0 ? float(kInputMax) : float(kInt8Max - zero),
                  low = value == 0 ? -high : float(kInt8Min - zero);
      torch::Tensor at_end = seen[value].ge(high);
      if (low < 0) at_end = at_end.logical_or(seen[value].le(low));
      saturated[value] += static_cast<uint64_t>(at_end.sum().item<int64_t>());
      elements[value] += static_cast<uint64_t>(seen[value].numel());
    }
  }
  laboratory.use(laboratory.plain());
  json rows = json::array();
  for (size_t value = 0; value < values; ++value) {
    rows.push_back(
        {{"value", value},
         {"scale", scales.values[value].scale},
         {"saturated", saturated[value]},
         {"elements", elements[value]},
         {"share", double(saturated[value]) / double(std::max<uint64_t>(1, elements[value]))}});
  }
  return rows;
}

// A few poses through evaluate_fixed_point: what the sweeps' imitation is worth.
json compare_with_integers(Laboratory& laboratory, const Variant& variant,
                           const quantize::Scales& scales, uint32_t poses) {
  laboratory.use(variant);
  model::PoseUNet& unet = laboratory.model().unet();
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  const quantize::QuantisedNetwork quantised(network, scales);
  uint64_t differing = 0, elements = 0;
  float largest_step = 0;
  double head_difference = 0;
  poses = std::min<uint32_t>(poses, static_cast<uint32_t>(laboratory.poses().size()));
  for (uint32_t p = 0; p < poses; ++p) {
    const torch::Tensor& input =
        laboratory.poses()[p * laboratory.poses().size() / poses].posed.input;
    std::vector<int16_t> steps(static_cast<size_t>(input.numel()));
    for (size_t i = 0; i < steps.size(); ++i)
      steps[i] = quantise_input(input.const_data_ptr<float>()[i], scales.values[0].scale);
    const FixedPointValues integers = evaluate_fixed_point(network, quantised.view(), steps);
    const std::vector<torch::Tensor> fake = unet.evaluate_values(input);
    for (size_t value = 1; value < fake.size(); ++value) {
      const torch::Tensor rows = fake[value].permute({0, 2, 3, 1}).contiguous();
      const float* seen = rows.const_data_ptr<float>();
      if (value + 1 == fake.size()) {
        for (size_t i = 0; i < integers.result.size(); ++i) {
          head_difference =
              std::max(head_difference, std::abs(double(seen[i]) - integers.result[i]));
        }
        continue;
      }
      for (size_t i = 0; i < integers.values[value].size(); ++i) {
        const float difference =
            std::abs(seen[i] - float(integers.values[value][i] - scales.values[value].zero_point));
        largest_step = std::max(largest_step, difference);
        differing += difference != 0;
      }
      elements += integers.values[value].size();
    }
  }
  laboratory.use(laboratory.plain());
  return {{"poses", poses},
          {"values", elements},
          {"values_that_differ", differing},
          {"largest_difference_steps", largest_step},
          {"largest_head_difference", head_difference}};
}

// A package's static values beside a network that is rounded somehow.
Variant packed(const torch::Tensor& weights,
               std::shared_ptr<const model::FakeQuantisation> rounding) {
  return {weights, std::move(rounding), true};
}

// Rows that differ in their calibration alone. "ptq" is what a package gets.
std::vector<std::pair<std::string, CalibrationOptions>> calibrations(
    const CalibrationOptions& chosen) {
  const auto with = [&](RangeMethod method, double percentile, WeightRange weights) {
    CalibrationOptions options = chosen;
    options.method = method, options.percentile = percentile, options.weights = weights;
    return options;
  };
  return {{"ptq", chosen},
          {"ptq_minmax", with(RangeMethod::kMinMax, 0, WeightRange::kMaxAbs)},
          {"ptq_percentile_99.9", with(RangeMethod::kPercentile, 99.9, WeightRange::kMaxAbs)},
          {"ptq_percentile", with(RangeMethod::kPercentile, 99.99, WeightRange::kMaxAbs)},
          {"ptq_mse", with(RangeMethod::kSmallestError, 0, WeightRange::kMaxAbs)},
          {"ptq_mse_of_weights_too",
           with(RangeMethod::kSmallestError, 0, WeightRange::kSmallestError)}};
}

torch::Tensor weights_of(const std::string& file, model::PoseUNet& unet) {
  const torch::Tensor kept = unet.weights().detach().clone();
  train::load_weights(file, unet);
  const torch::Tensor loaded = unet.weights().detach().clone();
  torch::NoGradGuard no_gradient;
  unet.weights().copy_(kept);
  return loaded;
}

std::vector<Row> make_rows(const Network& network, const quantize::ActivationStatistics& statistics,
                           const CalibrationOptions& calibration, const Variant& ptq,
                           const std::optional<Variant>& qat) {
  std::vector<Row> rows;
  for (const auto& [name, options] : calibrations(calibration)) {
    const quantize::Scales scales = quantize::choose_scales(network, statistics, options);
    rows.push_back({name, packed(ptq.weights, quantize::fake_quantisation(scales)), name == "ptq"});
  }
  if (qat) {
    rows.push_back({"qat", *qat, true});
    rows.push_back({"qat_weights_in_f32", {qat->weights, nullptr}});
  }
  const quantize::Scales scales = quantize::choose_scales(network, statistics, calibration);
  rows.push_back({"dynamic", packed(ptq.weights, dynamic_ranges(scales)), true});
  rows.push_back(
      {"ptq_int8_input", packed(ptq.weights, int8_input(scales, statistics.input_max)), true});
  rows.push_back(
      {"only_input_int16", {ptq.weights, only_input(quantize::fake_quantisation(scales))}, true});
  rows.push_back({"only_input_int8",
                  {ptq.weights, only_input(int8_input(scales, statistics.input_max))},
                  true});
  rows.push_back({"ptq_float_head", packed(ptq.weights, float_head(scales)), true});
  rows.push_back({"ptq_head_of_one_scale", packed(ptq.weights, head_of_one_scale(scales)), true});
  return rows;
}

double number(const json& row, const char* key) {
  return row.contains(key) && row.at(key).is_number() ? row.at(key).get<double>() : NAN;
}

// The mean over members of every number of the rows with one name; what is missing in one member is
// missing in the mean.
json mean_row(const std::vector<const json*>& rows) {
  json mean = {{"name", rows.front()->at("name")}};
  for (const auto& [key, value] : rows.front()->items()) {
    if (!value.is_number()) continue;
    double sum = 0;
    for (const json* row : rows) sum += number(*row, key.c_str());
    mean[key] = finite(sum / static_cast<double>(rows.size()));
  }
  return mean;
}

const json* find_row(const json& report, const std::string& name) {
  for (const json& row : report.at("rows")) {
    if (row.at("name") == name) return &row;
  }
  return nullptr;
}

}  // namespace

json evaluate_quantization(train::TrainedAvatar& avatar, const train::RunDirectory& run,
                           const QuantizationOptions& options) {
  train::Progress progress("evaluate " + run.path, options.quiet);
  std::vector<float> storage;
  model::PoseUNet& unet = avatar.model().unet();
  const Network network = unet.export_network(storage);
  const quantize::ActivationStatistics statistics =
      quantize::observe_activations(avatar, options.calibration.poses);
  const quantize::Scales scales = quantize::choose_scales(network, statistics, options.calibration);
  const Variant ptq = packed(unet.weights().detach().clone(), quantize::fake_quantisation(scales));
  std::optional<Variant> qat;
  if (options.fine_tune) {
    const quantize::FineTuned tuned = quantize::fine_tune(avatar, run, *options.fine_tune);
    qat = packed(weights_of(tuned.weights, unet), quantize::fake_quantisation(tuned.scales));
  }
  std::vector<Row> rows = make_rows(network, statistics, options.calibration, ptq, qat);
  if (!avatar.model().statics().empty())
    rows.push_back({"static_int8", packed(ptq.weights, nullptr), true});
  const std::vector<std::pair<json, Variant>> layers = single_layers(network, ptq.weights, scales);

  const train::InterruptGuard interrupt;
  Laboratory laboratory(avatar, options);
  size_t done = 0;
  const auto step = [&](const std::string& what) {
    if (interrupt.requested()) throw train::Interrupted("evaluate: stopped; nothing was written");
    progress.show(double(done++) / double(rows.size() + layers.size()), what);
  };
  const Score plain = laboratory.score_of_plain();
  json report{{"run", run.path},
              {"identity", std::filesystem::path(avatar.data().directory()).filename().string()},
              {"calibration", quantize::describe(options.calibration)},
              {"calibration_poses", statistics.poses},
              {"poses", laboratory.poses().size()},
              {"pictures", laboratory.picture_count()},
              {"f32_psnr_db", finite(plain.truth.psnr_db())},
              {"frozen_picture", laboratory.frozen_sequences()}};
  for (const Row& row : rows) {
    step(row.name);
    const Score score = laboratory.score(row.variant);
    json entry = describe(score, plain);
    entry["name"] = row.name;
    if (row.sequences) entry.update(laboratory.score_sequences(row.variant));
    report["rows"].push_back(entry);
    if (row.name == "ptq") report["worst_poses"] = worst_poses(laboratory, score, plain);
  }
  for (const auto& [name, variant] : layers) {
    step("layer " + name.at("layer").dump());
    json entry = name;
    entry.update(describe(laboratory.score(variant), plain));
    report["layers"].push_back(entry);
  }
  report["saturation"] = count_saturation(laboratory, ptq, scales);
  report["integer_reference"] =
      compare_with_integers(laboratory, ptq, scales, options.integer_poses);
  return report;
}

json summarise_quantization(const std::vector<json>& reports) {
  json summary;
  for (const json& row : reports.front().at("rows")) {
    std::vector<const json*> same;
    for (const json& report : reports) {
      if (const json* found = find_row(report, row.at("name"))) same.push_back(found);
    }
    if (same.size() == reports.size()) summary["rows"].push_back(mean_row(same));
  }
  for (const char* name : {"ptq", "qat"}) {
    if (const json* row = find_row(summary, name)) summary[name] = *row;
  }
  const json& ptq = summary.at("ptq");
  summary["psnr_drop_db_mean"] = ptq.at("psnr_drop_db");
  summary["psnr_to_f32_db"] = ptq.at("psnr_to_f32_db");
  summary["difference_psnr_db"] = {{"slow_motion", ptq.at("slow_motion_db")},
                                   {"trembling_pose", ptq.at("trembling_pose_db")}};
  const auto worst =
      std::max_element(reports.begin(), reports.end(), [&](const json& a, const json& b) {
        return number(*find_row(a, "ptq"), "psnr_drop_db") <
               number(*find_row(b, "ptq"), "psnr_drop_db");
      });
  summary["worst_member"] = {{"identity", worst->at("identity")},
                             {"run", worst->at("run")},
                             {"psnr_drop_db", find_row(*worst, "ptq")->at("psnr_drop_db")},
                             {"psnr_to_f32_db", find_row(*worst, "ptq")->at("psnr_to_f32_db")}};
  summary["members"] = reports;
  summary["definition"] =
      "PSNR as everywhere: foreground over mid-grey, stored sRGB values, pooled over held-out "
      "poses and held-out views; drop: f32 to the "
      "truth minus the row's; psnr_to_f32_db: against the float network's pictures; slow_motion "
      "and trembling_pose: PSNR of the change "
      "from "
      "frame to frame against the float network's change, before rounding to 8 bits "
      "(frozen_picture: what a picture that never changes "
      "scores); layers: only that layer's weights and output rounded. All rows by the trainer's "
      "fake-quantised UNet; integer_reference: "
      "its "
      "difference from the integers.";
  return summary;
}

}  // namespace figurine::reconstruction
