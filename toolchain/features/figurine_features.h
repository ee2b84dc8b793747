// figurine-features: the project's own network for comparing pictures of people, because no
// pretrained one may be shipped (docs/features.md). Five convolutions, then the mean and the
// greatest value of every channel, then F = 32 features of length sqrt(F). It was trained to tell
// the training members of a population apart whatever their pose and the camera
// (feature_trainer.h). It is neither LPIPS nor an Inception, and no report may call its numbers
// LPIPS or FID.
//
// Pictures come in at 128 x 128; larger ones are shrunk by a triangle filter as wide as the ratio.
// The network has no normalisation across positions, so an activation depends on its surroundings
// alone.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "toolchain/features/feature_network.h"
#include "toolchain/features/perceptual_embedding.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/tensor.h"

namespace figurine::features {

inline constexpr char kFigurineFeatures[] = "figurine-features";
inline constexpr int64_t kFeatureSide_px = 128;
inline constexpr int64_t kFeatureDimension = 32;

struct FeatureStage {
  int64_t in, out, kernel, stride;  // padding kernel / 2, then ReLU
};
inline constexpr FeatureStage kFeatureStages[] = {
    {3, 24, 5, 2}, {24, 48, 3, 2}, {48, 72, 3, 2}, {72, 96, 3, 2}, {96, 96, 3, 1}};
inline constexpr size_t kFeatureLayers = std::size(kFeatureStages);

// Where each parameter lies in the flat tensor of all of them.
struct FeatureParameter {
  std::string name;  // "stage.N.weight" [out,in,k,k], "stage.N.bias", "embedding.weight" [F,2C],
                     // "embedding.bias"
  std::vector<int64_t> shape;
  int64_t begin = 0;
};
const std::vector<FeatureParameter>& feature_parameters();
int64_t feature_parameter_count();

// [P]: normal of variance 2 / inputs (He), biases zero.
torch::Tensor initial_feature_weights(uint64_t seed);

// Of the stages, [n,C,H,W], as below.
std::vector<torch::Tensor> feature_activations(const torch::Tensor& weights,
                                               const torch::Tensor& pictures);

struct FeatureOutput {
  std::vector<torch::Tensor> activations;
  torch::Tensor features;  // [n,F], every row of length sqrt(F)
};
// weights: [P]; pictures: [n,3,H,W] in [0,1], 128 x 128 wherever the features are looked at.
// Differentiable by both.
FeatureOutput run_feature_network(const torch::Tensor& weights, const torch::Tensor& pictures);

// [1,3,128,128] of a square picture of any size. Throws InputError if it is not square.
torch::Tensor prepare_for_features(const RgbView& picture);

class FigurineFeatures : public FeatureNetwork,
                         public PerceptualNetwork,
                         public model::PictureDistance {
 public:
  // distance: of every layer. provenance: as the file's metadata.
  FigurineFeatures(torch::Tensor weights, std::vector<LayerWeights> distance,
                   std::map<std::string, std::string> provenance);
  // Throws InputError naming file, tensor and reason.
  static FigurineFeatures load(const std::string& path);
  void save(const std::string& path) const;

  const std::string& name() const override;
  nlohmann::json describe() const override;
  size_t dimension() const override { return kFeatureDimension; }
  const std::map<std::string, std::string>& provenance() const { return provenance_; }

  // In a loss pictures keep their own size, and need not be square.
  uint32_t least_side_px() const override { return 1; }
  torch::Tensor between(const torch::Tensor& seen, const torch::Tensor& truth) const override;

 private:
  void features_of(const RgbView& picture, std::span<double> features) const override;
  std::vector<float> embedding_of(const RgbView& picture) const override;

  torch::Tensor weights_;               // [P]
  std::vector<LayerWeights> distance_;  // of the layers
  std::map<std::string, std::string> provenance_;
  std::string file_, hash_;
};

}  // namespace figurine::features
