#include "toolchain/features/perceptual_embedding.h"

#include "figurine/check.h"
#include "toolchain/tensor_operations.h"

namespace figurine::features {

namespace {

torch::Tensor norms(const torch::Tensor& activations) {
  return activations.square().sum(1, true).sqrt();
}

torch::Tensor normalised(const torch::Tensor& activations, double floor) {
  return activations / (norms(activations) + floor);
}

}  // namespace

std::vector<float> perceptual_embedding(const std::vector<torch::Tensor>& activations,
                                        const std::vector<LayerWeights>& weights) {
  FIG_CHECK(activations.size() == weights.size(), "weights for every layer");
  const torch::NoGradGuard no_gradient;
  std::vector<float> embedding;
  for (size_t l = 0; l < activations.size(); ++l) {
    const double positions = static_cast<double>(activations[l].size(2) * activations[l].size(3));
    const torch::Tensor factor = (weights[l].channels / positions).sqrt().view({1, -1, 1, 1});
    const torch::Tensor layer =
        (normalised(activations[l], weights[l].floor) * factor).contiguous();
    embedding.insert(embedding.end(), layer.data_ptr<float>(),
                     layer.data_ptr<float>() + layer.numel());
  }
  return embedding;
}

torch::Tensor perceptual_distance(const std::vector<torch::Tensor>& activations,
                                  const std::vector<LayerWeights>& weights) {
  FIG_CHECK(activations.size() == weights.size(), "weights for every layer");
  torch::Tensor sum = torch::zeros({}, torch::kFloat);
  for (size_t l = 0; l < activations.size(); ++l) {
    const torch::Tensor& a = activations[l];
    // A norm whose gradient at zero is zero; that of norms() is infinite there.
    const torch::Tensor unit =
        a / (at::linalg_vector_norm(a, 2, at::IntArrayRef{1}, true) + weights[l].floor);
    const torch::Tensor difference = unit.narrow(0, 0, 1) - unit.narrow(0, 1, 1);
    sum = sum + (difference.square() * weights[l].channels.view({1, -1, 1, 1})).sum(1).mean();
  }
  return sum;
}

std::vector<double> layer_norms(const std::vector<torch::Tensor>& activations) {
  const torch::NoGradGuard no_gradient;
  std::vector<double> means;
  for (const torch::Tensor& layer : activations)
    means.push_back(norms(layer).to(torch::kFloat64).mean().item<double>());
  return means;
}

std::vector<double> layer_distances(const std::vector<torch::Tensor>& a,
                                    const std::vector<torch::Tensor>& b,
                                    const std::vector<double>& floors) {
  const torch::NoGradGuard no_gradient;
  std::vector<double> distances;
  for (size_t l = 0; l < a.size(); ++l) {
    const double positions = static_cast<double>(a[l].size(2) * a[l].size(3));
    const torch::Tensor difference = normalised(a[l], floors[l]) - normalised(b[l], floors[l]);
    distances.push_back(difference.to(torch::kFloat64).square().sum().item<double>() / positions);
  }
  return distances;
}

torch::Tensor to_tensor(const RgbView& picture) {
  // from_blob wants a mutable pointer; nothing writes through it.
  return torch::from_blob(const_cast<float*>(picture.values.data()),
                          {1, 3, picture.height_px, picture.width_px});
}

}  // namespace figurine::features
