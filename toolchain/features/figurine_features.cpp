#include "toolchain/features/figurine_features.h"

#include <torch/nn/functional/normalization.h>
#include <cmath>
#include <cstring>

#include "toolchain/error.h"
#include "toolchain/model/convolution.h"
#include "toolchain/random/counter.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::features {

namespace {

constexpr char kFormat[] = "figurine-features 1";
constexpr uint64_t kInitialWeights = 1;  // stream of the seed

int64_t count_of(const std::vector<int64_t>& shape) {
  int64_t count = 1;
  for (const int64_t side : shape) count *= side;
  return count;
}

std::vector<FeatureParameter> lay_out() {
  std::vector<FeatureParameter> parameters;
  int64_t end = 0;
  const auto add = [&](const std::string& name, const std::vector<int64_t>& shape) {
    parameters.push_back({name, shape, end});
    end += count_of(shape);
  };
  for (size_t i = 0; i < kFeatureLayers; ++i) {
    const FeatureStage& stage = kFeatureStages[i];
    add("stage." + std::to_string(i) + ".weight",
        {stage.out, stage.in, stage.kernel, stage.kernel});
    add("stage." + std::to_string(i) + ".bias", {stage.out});
  }
  add("embedding.weight", {kFeatureDimension, 2 * kFeatureStages[kFeatureLayers - 1].out});
  add("embedding.bias", {kFeatureDimension});
  return parameters;
}

torch::Tensor part(const torch::Tensor& weights, size_t index) {
  const FeatureParameter& parameter = feature_parameters()[index];
  return weights.narrow(0, parameter.begin, count_of(parameter.shape)).view(parameter.shape);
}

std::string channel_weights_name(size_t layer) {
  return "distance." + std::to_string(layer) + ".channel_weight";
}

std::string floor_name(size_t layer) { return "distance." + std::to_string(layer) + ".floor"; }

train::NamedTensor named(const torch::Tensor& tensor, const std::vector<int64_t>& shape) {
  const torch::Tensor values = tensor.contiguous();
  return {shape, {values.data_ptr<float>(), values.data_ptr<float>() + values.numel()}};
}

std::vector<float> values_of(const train::TensorFile& file, const std::string& path,
                             const std::string& name, const std::vector<int64_t>& shape) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw InputError(path + ": " + name + ": missing");
  if (found->second.shape != shape)
    throw InputError(path + ": " + name + ": is of another shape than figurine-features has");
  return found->second.values;
}

}  // namespace

const std::vector<FeatureParameter>& feature_parameters() {
  static const std::vector<FeatureParameter> parameters = lay_out();
  return parameters;
}

int64_t feature_parameter_count() {
  return feature_parameters().back().begin + count_of(feature_parameters().back().shape);
}

torch::Tensor initial_feature_weights(uint64_t seed) {
  const torch::Tensor weights = torch::zeros({feature_parameter_count()});
  for (size_t i = 0; i < feature_parameters().size(); ++i) {
    const FeatureParameter& parameter = feature_parameters()[i];
    if (parameter.shape.size() == 1) continue;
    auto generator =
        at::make_generator<at::CPUGeneratorImpl>(random::random_bits(seed, kInitialWeights, i));
    const double inputs = static_cast<double>(count_of(parameter.shape) / parameter.shape[0]);
    part(weights, i).copy_(torch::randn(parameter.shape, generator) * std::sqrt(2 / inputs));
  }
  return weights;
}

std::vector<torch::Tensor> feature_activations(const torch::Tensor& weights,
                                               const torch::Tensor& pictures) {
  std::vector<torch::Tensor> activations;
  torch::Tensor x = (pictures - 0.5) * 4;
  for (size_t l = 0; l < kFeatureLayers; ++l) {
    const FeatureStage& stage = kFeatureStages[l];
    x = torch::relu(model::conv2d(x, part(weights, 2 * l), part(weights, 2 * l + 1), stage.stride,
                                  stage.kernel / 2));
    activations.push_back(x);
  }
  return activations;
}

FeatureOutput run_feature_network(const torch::Tensor& weights, const torch::Tensor& pictures) {
  FeatureOutput out{feature_activations(weights, pictures), {}};
  const torch::Tensor& x = out.activations.back();
  const size_t next = 2 * kFeatureLayers;
  const torch::Tensor pooled = torch::cat({x.mean({2, 3}), x.amax({2, 3})}, 1);
  const torch::Tensor features =
      torch::linear(pooled, part(weights, next), part(weights, next + 1));
  out.features = torch::nn::functional::normalize(features) *
                 std::sqrt(static_cast<double>(kFeatureDimension));
  return out;
}

torch::Tensor prepare_for_features(const RgbView& picture) {
  if (picture.width_px != picture.height_px) {
    throw InputError("figurine-features: pictures must be square, not " +
                     std::to_string(picture.width_px) + "x" + std::to_string(picture.height_px));
  }
  const torch::NoGradGuard no_gradient;
  const torch::Tensor given = to_tensor(picture);
  if (given.size(2) == kFeatureSide_px) return given.clone();
  return at::_upsample_bilinear2d_aa(given, {kFeatureSide_px, kFeatureSide_px}, false);
}

FigurineFeatures::FigurineFeatures(torch::Tensor weights, std::vector<LayerWeights> distance,
                                   std::map<std::string, std::string> provenance)
    : weights_(std::move(weights)),
      distance_(std::move(distance)),
      provenance_(std::move(provenance)) {}

FigurineFeatures FigurineFeatures::load(const std::string& path) {
  const train::TensorFile file = train::read_tensor_file(path);
  const auto format = file.metadata.find("format");
  if (format == file.metadata.end() || format->second != kFormat) {
    throw InputError(path + ": format: is no file of figurine-train features (" + kFormat + ")");
  }
  const torch::Tensor weights = torch::empty({feature_parameter_count()});
  for (size_t i = 0; i < feature_parameters().size(); ++i) {
    const FeatureParameter& parameter = feature_parameters()[i];
    const std::vector<float> values = values_of(file, path, parameter.name, parameter.shape);
    std::memcpy(weights.data_ptr<float>() + parameter.begin, values.data(),
                values.size() * sizeof(float));
  }
  std::vector<LayerWeights> distance;
  for (size_t l = 0; l < kFeatureLayers; ++l) {
    const std::vector<float> values =
        values_of(file, path, channel_weights_name(l), {kFeatureStages[l].out});
    for (const float weight : values) {
      if (weight < 0)
        throw InputError(path + ": " + channel_weights_name(l) + ": holds a negative weight");
    }
    const float floor = values_of(file, path, floor_name(l), {1})[0];
    if (!(floor > 0)) throw InputError(path + ": " + floor_name(l) + ": is not above 0");
    distance.push_back({torch::tensor(values), floor});
  }
  FigurineFeatures network(weights, std::move(distance), file.metadata);
  network.provenance_.erase("format");
  network.file_ = path, network.hash_ = hash_of_file(path);
  return network;
}

void FigurineFeatures::save(const std::string& path) const {
  train::TensorFile file{.metadata = provenance_, .tensors = {}};
  file.metadata["format"] = kFormat;
  for (size_t i = 0; i < feature_parameters().size(); ++i) {
    file.tensors[feature_parameters()[i].name] =
        named(part(weights_, i), feature_parameters()[i].shape);
  }
  for (size_t l = 0; l < kFeatureLayers; ++l) {
    file.tensors[channel_weights_name(l)] = named(distance_[l].channels, {kFeatureStages[l].out});
    file.tensors[floor_name(l)] = {{1}, {static_cast<float>(distance_[l].floor)}};
  }
  train::write_tensor_file(path, file);
}

const std::string& FigurineFeatures::name() const {
  static const std::string name = kFigurineFeatures;
  return name;
}

nlohmann::json FigurineFeatures::describe() const {
  return {{"name", name()},
          {"file", file_},
          {"hash", hash_},
          {"dimension", kFeatureDimension},
          {"parameters", feature_parameter_count()},
          {"provenance", provenance_}};
}

void FigurineFeatures::features_of(const RgbView& picture, std::span<double> features) const {
  const torch::NoGradGuard no_gradient;
  const torch::Tensor row = run_feature_network(weights_, prepare_for_features(picture))
                                .features.to(torch::kFloat64)
                                .contiguous();
  std::memcpy(features.data(), row.data_ptr<double>(), features.size_bytes());
}

std::vector<float> FigurineFeatures::embedding_of(const RgbView& picture) const {
  const torch::NoGradGuard no_gradient;
  return perceptual_embedding(
      run_feature_network(weights_, prepare_for_features(picture)).activations, distance_);
}

torch::Tensor FigurineFeatures::between(const torch::Tensor& seen,
                                        const torch::Tensor& truth) const {
  return perceptual_distance(feature_activations(weights_, torch::stack({seen, truth})), distance_);
}

}  // namespace figurine::features
