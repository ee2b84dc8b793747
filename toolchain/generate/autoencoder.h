// The variational autoencoder of variant `latent`: a member's standardised weights, zero-padded and
// folded into a square picture of one channel, to a map of an eighth of its side with a few
// channels, and back.
//
//   encoder  3 convolutions 3x3 of stride 2 (16, 32, 64 channels), a residual block, a convolution
//            to mean and log-variance
//   decoder  a convolution, a residual block, 3 transposed convolutions 4x4 of stride 2 (32, 16, 1
//            channels)
//   loss     mean square error of the values + kl_weight x mean over the latent values of
//            KL(N(mean, variance) | N(0, 1))
//
// Neighbours in such a picture are neighbours in memory and nothing else, which is what the paper
// holds against it.
//
// Based on: the paper, section 5.3 (after Soro et al., Diffusion-based neural network weights
// generation, 2025); Rombach et al., Latent diffusion, 2022; Kingma and Welling, Auto-encoding
// variational Bayes, 2014.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "toolchain/generate/flat_parameters.h"
#include "toolchain/generate/flat_trainer.h"
#include "toolchain/generate/model_space.h"
#include "toolchain/generate/sampler_settings.h"
#include "toolchain/random/shuffled_order.h"

namespace figurine::generate {

class Autoencoder : public WeightCodec {
 public:
  // width: values of a member, W. Random weights from the seed. Throws InputError if channels are
  // none.
  Autoencoder(size_t width, const AutoencoderSettings& settings, uint64_t seed);

  struct Posterior {
    torch::Tensor mean, log_variance;  // [B,C,S,S]
  };
  Posterior posterior(const torch::Tensor& z) const;          // [B,W], differentiable
  torch::Tensor reconstruct(const torch::Tensor& map) const;  // [B,C,S,S] to [B,W], differentiable

  measure::RowMatrix encode(const measure::RowMatrix& z) const override;  // means
  measure::RowMatrix decode(const measure::RowMatrix& latents) const override;
  const std::vector<size_t>& token_sizes() const override {
    return token_sizes_;
  }  // S rows of the map

  FlatParameters& parameters() { return parameters_; }
  int64_t latent_side() const { return side_ / 8; }  // S
  int64_t channels() const { return channels_; }     // C

 private:
  int64_t width_, channels_, side_;
  std::vector<size_t> token_sizes_;
  mutable FlatParameters parameters_;
};

// Its batches and loss. z: standardised weights [N,W] of the members to learn from and of those to
// validate on; the validation loss is the mean square error of what is decoded from their means.
class Autoencoding : public FlatModel {
 public:
  Autoencoding(std::shared_ptr<Autoencoder> autoencoder, const SamplerSettings& settings,
               const measure::RowMatrix& training, const measure::RowMatrix& validation);

  torch::Tensor& weights() override { return autoencoder_->parameters().weights(); }
  torch::Tensor& gradients() override { return autoencoder_->parameters().gradients(); }
  torch::Tensor loss(uint64_t iteration, Share share) override;
  double validation_loss() override;

 private:
  std::shared_ptr<Autoencoder> autoencoder_;
  SamplerSettings settings_;
  torch::Tensor training_, validation_;
  random::ShuffledOrder order_;
};

}  // namespace figurine::generate
