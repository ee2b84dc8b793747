#include "toolchain/generate/model_space.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "toolchain/error.h"

namespace figurine::generate {

using measure::RowMatrix;
using measure::RowVector;
using measure::Token;

namespace {

constexpr std::pair<Variant, const char*> kVariants[] = {{Variant::kLayer, "layer"},
                                                         {Variant::kFlat, "flat"},
                                                         {Variant::kLatent, "latent"},
                                                         {Variant::kBasis, "basis"}};

}  // namespace

const char* to_string(Variant variant) {
  for (const auto& [known, name] : kVariants) {
    if (known == variant) return name;
  }
  return "?";
}

Variant variant_from_string(const std::string& name) {
  for (const auto& [variant, known] : kVariants) {
    if (name == known) return variant;
  }
  throw InputError("variant '" + name + "' is none of layer, flat, latent, basis");
}

ModelSpace::ModelSpace(const RowMatrix& training, const std::vector<Token>& tokens,
                       const ModelSpaceOptions& options, std::shared_ptr<const WeightCodec> codec)
    : options_(options), standardisation_(training, tokens), codec_(std::move(codec)) {
  if ((options_.variant == Variant::kLatent) != (codec_ != nullptr))
    throw std::logic_error("an autoencoder belongs to variant latent");
  const size_t values = static_cast<size_t>(training.cols());
  if (options_.variant == Variant::kLayer) {
    for (const Token& token : tokens) token_sizes_.push_back(token.size);
    size_ = values, dimension_ = standardisation_.varying();
  } else if (options_.variant == Variant::kFlat) {
    token_sizes_.assign((values + options_.chunk - 1) / options_.chunk, options_.chunk);
    size_ = token_sizes_.size() * options_.chunk, dimension_ = standardisation_.varying();
  } else if (options_.variant == Variant::kLatent) {
    const RowMatrix latents = codec_->encode(standardisation_.standardise(training));
    latent_mean_ = latents.colwise().mean();
    latent_scale_ = std::sqrt((latents.rowwise() - latent_mean_).array().square().mean());
    if (!(latent_scale_ > 0))
      throw InputError("variant latent: the autoencoder gives all members the same latent values");
    token_sizes_ = codec_->token_sizes();
    size_ = dimension_ = static_cast<size_t>(latents.cols());
  } else {
    const RowMatrix z = standardisation_.standardise(training);
    for (const Token& token : tokens) {
      const measure::PrincipalBasis basis(z, token.begin, token.size);
      // A token that nothing varies in (rank 0) still needs a place: one direction of zeros.
      const size_t rank = std::min(options_.rank, basis.rank());
      directions_.push_back(rank > 0 ? basis.directions(rank)
                                     : RowMatrix::Zero(1, static_cast<Eigen::Index>(token.size)));
      const double mean_square =
          rank > 0 ? basis.variance().head(static_cast<Eigen::Index>(rank)).mean() : 0;
      coordinate_scale_.push_back(mean_square > 0 ? std::sqrt(mean_square) : 1);
      token_sizes_.push_back(std::max<size_t>(1, rank));
      size_ += token_sizes_.back(), dimension_ += rank;
    }
  }
}

RowMatrix ModelSpace::encode(const RowMatrix& weights) const {
  const RowMatrix z = standardisation_.standardise(weights);
  if (codec_) return (codec_->encode(z).rowwise() - latent_mean_) / latent_scale_;
  RowMatrix out = RowMatrix::Zero(z.rows(), static_cast<Eigen::Index>(size_));
  if (options_.variant != Variant::kBasis) {
    out.leftCols(z.cols()) = z;
    return out;
  }
  Eigen::Index at = 0;
  for (size_t l = 0; l < directions_.size(); ++l) {
    const Token& token = standardisation_.tokens()[l];
    const auto part =
        z.middleCols(static_cast<Eigen::Index>(token.begin), static_cast<Eigen::Index>(token.size));
    out.middleCols(at, directions_[l].rows()).noalias() =
        part * directions_[l].transpose() / coordinate_scale_[l];
    at += directions_[l].rows();
  }
  return out;
}

RowVector ModelSpace::decode(const RowVector& values) const {
  const Eigen::Index width = standardisation_.mean().size();
  if (codec_)
    return standardisation_.restore(codec_->decode(latent_mean_ + latent_scale_ * values).row(0));
  if (options_.variant != Variant::kBasis) return standardisation_.restore(values.head(width));
  RowVector z = RowVector::Zero(width);
  Eigen::Index at = 0;
  for (size_t l = 0; l < directions_.size(); ++l) {
    const Token& token = standardisation_.tokens()[l];
    z.segment(static_cast<Eigen::Index>(token.begin), static_cast<Eigen::Index>(token.size))
        .noalias() =
        coordinate_scale_[l] * values.segment(at, directions_[l].rows()) * directions_[l];
    at += directions_[l].rows();
  }
  return standardisation_.restore(z);
}

}  // namespace figurine::generate
