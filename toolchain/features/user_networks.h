// Networks whose weights the user brings, because they may not be shipped: LPIPS over AlexNet, and
// an Inception for FID and KID. What the files hold, and how to make them, is in docs/features.md.
// The name of a file proves nothing: reports name it with its hash.
//
// Based on: Zhang et al., 2018, and its code (AlexNet, version 0.1: shift and scale of the input,
// five ReLU layers, weights of 1x1 convolutions); Krizhevsky, One weird trick for parallelizing
// convolutional neural networks, 2014 (this AlexNet); Heusel et al., 2017 (Inception, 299 x 299).
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "toolchain/features/feature_network.h"
#include "toolchain/model/perceptual.h"

namespace figurine::features {

class LpipsAlex : public PerceptualNetwork, public model::PictureDistance {
 public:
  // .npz, or TorchScript otherwise, with the arrays as the authors' LPIPS(net="alex").state_dict()
  // names them. Throws InputError naming file, array and reason.
  static LpipsAlex load(const std::string& path);
  LpipsAlex(LpipsAlex&&) noexcept;
  ~LpipsAlex() override;

  const std::string& name() const override;
  nlohmann::json describe() const override;

  uint32_t least_side_px() const override;
  torch::Tensor between(const torch::Tensor& seen, const torch::Tensor& truth) const override;

 private:
  struct Weights;
  explicit LpipsAlex(std::unique_ptr<Weights> weights);
  // The network's own size: pictures are not scaled. Smaller than 31 on a side: InputError.
  std::vector<float> embedding_of(const RgbView& picture) const override;

  std::unique_ptr<Weights> weights_;
};

class InceptionFeatures : public FeatureNetwork {
 public:
  // TorchScript whose forward takes [1,3,299,299] in [-1,1] and gives [1,F] or [1,F,1,1]. It is run
  // once to learn F.
  explicit InceptionFeatures(const std::string& path);
  ~InceptionFeatures() override;

  const std::string& name() const override;
  nlohmann::json describe() const override;
  size_t dimension() const override;

 private:
  struct Script;
  void features_of(const RgbView& picture, std::span<double> features) const override;

  std::unique_ptr<Script> script_;
};

}  // namespace figurine::features
