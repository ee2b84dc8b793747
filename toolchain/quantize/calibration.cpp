#include "toolchain/quantize/calibration.h"

#include <algorithm>
#include <cstdio>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::quantize {

namespace {

// A pose far outside the training range may double the input before it saturates. One of 15 bits: a
// step is still 0.06 mm.
constexpr float kInputHeadroom = 2;

std::vector<size_t> spread_training_frames(const dataset::Dataset& data, uint32_t count) {
  std::vector<size_t> training, chosen;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    if (data.frames()[frame].split == dataset::FrameSplit::kTrain) training.push_back(frame);
  }
  if (training.empty()) throw InputError(data.directory() + ": no training pose to calibrate on");
  const size_t poses = std::clamp<size_t>(count, 1, training.size());
  for (size_t i = 0; i < poses; ++i) chosen.push_back(training[i * training.size() / poses]);
  return chosen;
}

Range choose_range(const Histogram& histogram, const CalibrationOptions& options) {
  switch (options.method) {
    case RangeMethod::kMinMax:
      break;
    case RangeMethod::kPercentile:
      return histogram.percentile(options.percentile);
    case RangeMethod::kSmallestError:
      return histogram.smallest_error();
  }
  return histogram.min_max();
}

std::span<const float> elements(const torch::Tensor& dense) {
  return {dense.const_data_ptr<float>(), static_cast<size_t>(dense.numel())};
}

std::string scale_name(size_t layer) { return "layer." + std::to_string(layer) + ".weight_scale"; }

std::vector<float> find(const train::TensorFile& file, const std::string& path,
                        const std::string& name, size_t size) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end() || found->second.values.size() != size) {
    throw InputError(path + ": " + name + ": is missing or of another network");
  }
  return found->second.values;
}

}  // namespace

std::string describe(const CalibrationOptions& options) {
  std::string text = "min/max";
  if (options.method == RangeMethod::kSmallestError) text = "smallest squared error";
  if (options.method == RangeMethod::kPercentile) {
    char number[32];
    std::snprintf(number, sizeof(number), "%g", options.percentile);
    text = std::string("percentile ") + number;
  }
  return text + ", weights " +
         (options.weights == WeightRange::kMaxAbs ? "max |w|" : "smallest squared error");
}

ActivationStatistics observe_activations(train::TrainedAvatar& avatar, uint32_t poses) {
  train::AvatarModel& model = avatar.model();
  std::vector<float> storage;
  const Network network = model.unet().export_network(storage);
  ActivationStatistics statistics{.group = scale_groups(network),
                                  .histograms = std::vector<Histogram>(network.layers.size() + 1)};
  for (size_t frame : spread_training_frames(avatar.data(), poses)) {
    const train::PosedBody posed =
        model.pose(model.from_capture(avatar.data().frames()[frame]).view());
    count_values(network, model.unet().evaluate_values(posed.input), statistics);
  }
  return statistics;
}

void count_values(const Network& network, const std::vector<torch::Tensor>& values,
                  ActivationStatistics& statistics) {
  statistics.input_max = std::max(statistics.input_max, values[0].abs().max().item<float>());
  for (size_t i = 0; i + 1 < network.layers.size(); ++i) {
    if (network.layers[i].op == LayerOp::kConv2d)
      statistics.histograms[statistics.group[i + 1]].add(elements(values[i + 1]));
  }
  ++statistics.poses;
}

std::vector<Quantisation> choose_value_scales(const Network& network,
                                              const ActivationStatistics& statistics,
                                              const CalibrationOptions& options) {
  std::vector<Quantisation> values(network.layers.size());
  values[0] = {.scale = std::max(kInputHeadroom * statistics.input_max, 1.0f) / float(kInputMax),
               .zero_point = 0};
  for (size_t value = 1; value < network.layers.size(); ++value) {
    const uint32_t group = statistics.group[value];
    values[value] = group == value
                        ? quantisation_of(choose_range(statistics.histograms[group], options))
                        : values[group];
  }
  return values;
}

Scales choose_scales(const Network& network, const ActivationStatistics& statistics,
                     const CalibrationOptions& options) {
  Scales scales{choose_value_scales(network, statistics, options), {}};
  scales.weight_scale = choose_weight_scales(network, scales.values, options.weights);
  return scales;
}

void save_scales(const std::string& path, const Scales& scales) {
  train::TensorFile file;
  train::NamedTensor scale{{static_cast<int64_t>(scales.values.size())}, {}}, zero_point = scale;
  for (const Quantisation& value : scales.values) {
    scale.values.push_back(value.scale);
    zero_point.values.push_back(static_cast<float>(value.zero_point));
  }
  file.tensors = {{"values.scale", scale}, {"values.zero_point", zero_point}};
  for (size_t i = 0; i < scales.weight_scale.size(); ++i) {
    const std::vector<float>& weights = scales.weight_scale[i];
    if (!weights.empty())
      file.tensors[scale_name(i)] = {{static_cast<int64_t>(weights.size())}, weights};
  }
  train::write_tensor_file(path, file);
}

Scales load_scales(const std::string& path, const Network& network) {
  const train::TensorFile file = train::read_tensor_file(path);
  const size_t layers = network.layers.size();
  const std::vector<float> scale = find(file, path, "values.scale", layers),
                           zero_point = find(file, path, "values.zero_point", layers);
  Scales scales{std::vector<Quantisation>(layers), std::vector<std::vector<float>>(layers)};
  for (size_t i = 0; i < layers; ++i) {
    scales.values[i] = {scale[i], static_cast<int32_t>(zero_point[i])};
    if (network.layers[i].op == LayerOp::kConv2d) {
      scales.weight_scale[i] = find(file, path, scale_name(i), network.layers[i].out_channels);
    }
  }
  return scales;
}

}  // namespace figurine::quantize
