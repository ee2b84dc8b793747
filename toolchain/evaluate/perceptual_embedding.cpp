#include "toolchain/evaluate/perceptual_embedding.h"

#include "figurine/check.h"

namespace figurine::evaluate {

namespace {

constexpr double kNormConstant = 1e-10;

torch::Tensor normalised(const torch::Tensor& activations) {
  return activations / (activations.square().sum(1, true).sqrt() + kNormConstant);
}

}  // namespace

std::vector<float> perceptual_embedding(const std::vector<torch::Tensor>& activations, const std::vector<torch::Tensor>& channel_weights) {
  FIG_CHECK(activations.size() == channel_weights.size(), "weights for every layer");
  const torch::NoGradGuard no_gradient;
  std::vector<float> embedding;
  for (size_t l = 0; l < activations.size(); ++l) {
    const double positions = static_cast<double>(activations[l].size(2) * activations[l].size(3));
    const torch::Tensor factor = (channel_weights[l] / positions).sqrt().view({1, -1, 1, 1});
    const torch::Tensor layer = (normalised(activations[l]) * factor).contiguous();
    embedding.insert(embedding.end(), layer.data_ptr<float>(), layer.data_ptr<float>() + layer.numel());
  }
  return embedding;
}

std::vector<double> layer_distances(const std::vector<torch::Tensor>& a, const std::vector<torch::Tensor>& b) {
  const torch::NoGradGuard no_gradient;
  std::vector<double> distances;
  for (size_t l = 0; l < a.size(); ++l) {
    const double positions = static_cast<double>(a[l].size(2) * a[l].size(3));
    distances.push_back((normalised(a[l]) - normalised(b[l])).to(torch::kFloat64).square().sum().item<double>() / positions);
  }
  return distances;
}

torch::Tensor to_tensor(const RgbView& picture) {
  // from_blob wants a mutable pointer; nothing writes through it.
  return torch::from_blob(const_cast<float*>(picture.values.data()), {1, 3, picture.height_px, picture.width_px});
}

}  // namespace figurine::evaluate
