// What a denoiser of weights works on: members of a population as vectors of unit scale, cut into
// the tokens of one of the paper's variants or of ours. Linear algebra alone, in double, found from
// the training part alone; no LibTorch.
//
// Letters: M rows of any members, N training members, W values of a member (weights, biases,
// shape), D values of a model vector, L tokens.
//
//   layer   one token a convolution and one for the shape: the standardised weights themselves (the
//           paper)
//   flat    the same values as one vector, zero-padded and cut into equal chunks (the paper's
//           ablation, after Peebles et al. 2022)
//   latent  what an autoencoder makes of the values, of one scale (the paper's ablation;
//           autoencoder.h)
//   basis   one token a convolution and one for the shape: coordinates in that token's principal
//           directions, at most `rank` of them (ours;
//           the paper's future work). Members that lie outside the training members' span cannot be
//               reached.
//
// Based on: the paper, section 4.2 and its ablation; Erkoc et al., HyperDiffusion, 2023
// (standardised weights, one token a layer).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "toolchain/measure/weight_space.h"

namespace figurine::generate {

enum class Variant : uint8_t { kLayer, kFlat, kLatent, kBasis };
const char* to_string(Variant variant);                // "layer", "flat", "latent", "basis"
Variant variant_from_string(const std::string& name);  // throws InputError naming the known ones

struct ModelSpaceOptions {
  Variant variant = Variant::kBasis;
  size_t rank = 64;     // of `basis`: most directions of a token
  size_t chunk = 4096;  // of `flat`: values of a token
};

// A learnt map from standardised weights to fewer values and back.
class WeightCodec {
 public:
  virtual ~WeightCodec() = default;
  virtual measure::RowMatrix encode(const measure::RowMatrix& z) const = 0;        // [M,W] to [M,D]
  virtual measure::RowMatrix decode(const measure::RowMatrix& latents) const = 0;  // [M,D] to [M,W]
  virtual const std::vector<size_t>& token_sizes() const = 0;                      // [L]
};

class ModelSpace {
 public:
  // training: [N,W] as read_weights gives them, N >= 2. codec: of `latent`, and of it alone.
  ModelSpace(const measure::RowMatrix& training, const std::vector<measure::Token>& tokens,
             const ModelSpaceOptions& options, std::shared_ptr<const WeightCodec> codec = nullptr);

  const ModelSpaceOptions& options() const { return options_; }
  const measure::Standardisation& standardisation() const { return standardisation_; }
  const std::vector<size_t>& token_sizes() const { return token_sizes_; }  // [L]; their sum is D
  size_t size() const { return size_; }                                    // D
  // Values that vary, the dimension that noise levels are placed by: the rest (dead channels,
  // padding) is 0 in every member.
  size_t dimension() const { return dimension_; }

  // weights: [M,W]; model vectors [M,D], of mean square 1 over the training members and the varying
  // values.
  measure::RowMatrix encode(const measure::RowMatrix& weights) const;
  // The weights [W] of a model vector [D]. encode(decode(x)) == x but for rounding, except where x
  // leaves its space (padding, dead values) and in `latent`, whose autoencoder only comes near.
  measure::RowVector decode(const measure::RowVector& values) const;

  // Of `basis`: directions of a token as orthonormal rows [K,size], and the factor between a model
  // value and a coordinate.
  const measure::RowMatrix& directions(size_t token) const { return directions_[token]; }
  double coordinate_scale(size_t token) const { return coordinate_scale_[token]; }

 private:
  ModelSpaceOptions options_;
  measure::Standardisation standardisation_;
  std::vector<size_t> token_sizes_;
  size_t size_ = 0, dimension_ = 0;
  std::vector<measure::RowMatrix> directions_;
  std::vector<double> coordinate_scale_;
  std::shared_ptr<const WeightCodec> codec_;
  measure::RowVector latent_mean_;  // [D]
  double latent_scale_ = 1;
};

}  // namespace figurine::generate
