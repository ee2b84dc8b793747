#include "toolchain/generate/model_space.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"

namespace figurine::generate {

using evaluate::RowMatrix;
using evaluate::RowVector;
using evaluate::Token;

namespace {

constexpr Variant kVariants[] = {Variant::kLayer, Variant::kFlat, Variant::kBasis};

}  // namespace

const char* to_string(Variant variant) { return variant == Variant::kLayer ? "layer" : variant == Variant::kFlat ? "flat" : "basis"; }

Variant variant_from_string(const std::string& name) {
  for (const Variant variant : kVariants) {
    if (name == to_string(variant)) return variant;
  }
  throw InputError("variant '" + name + "' is none of layer, flat, basis");
}

ModelSpace::ModelSpace(const RowMatrix& training, const std::vector<Token>& tokens, const ModelSpaceOptions& options)
    : options_(options), standardisation_(training, tokens) {
  const size_t values = static_cast<size_t>(training.cols());
  if (options_.variant == Variant::kLayer) {
    for (const Token& token : tokens) token_sizes_.push_back(token.size);
    size_ = values, dimension_ = standardisation_.varying();
  } else if (options_.variant == Variant::kFlat) {
    token_sizes_.assign((values + options_.chunk - 1) / options_.chunk, options_.chunk);
    size_ = token_sizes_.size() * options_.chunk, dimension_ = standardisation_.varying();
  } else {
    const RowMatrix z = standardisation_.standardise(training);
    for (const Token& token : tokens) {
      const evaluate::PrincipalBasis basis(z, token.begin, token.size);
      // A token that nothing varies in (rank 0) still needs a place: one direction of zeros.
      const size_t rank = std::min(options_.rank, basis.rank());
      directions_.push_back(rank > 0 ? basis.directions(rank) : RowMatrix::Zero(1, static_cast<Eigen::Index>(token.size)));
      const double mean_square = rank > 0 ? basis.variance().head(static_cast<Eigen::Index>(rank)).mean() : 0;
      coordinate_scale_.push_back(mean_square > 0 ? std::sqrt(mean_square) : 1);
      token_sizes_.push_back(std::max<size_t>(1, rank));
      size_ += token_sizes_.back(), dimension_ += rank;
    }
  }
}

RowMatrix ModelSpace::encode(const RowMatrix& weights) const {
  const RowMatrix z = standardisation_.standardise(weights);
  RowMatrix out = RowMatrix::Zero(z.rows(), static_cast<Eigen::Index>(size_));
  if (options_.variant != Variant::kBasis) {
    out.leftCols(z.cols()) = z;
    return out;
  }
  Eigen::Index at = 0;
  for (size_t l = 0; l < directions_.size(); ++l) {
    const Token& token = standardisation_.tokens()[l];
    const auto part = z.middleCols(static_cast<Eigen::Index>(token.begin), static_cast<Eigen::Index>(token.size));
    out.middleCols(at, directions_[l].rows()).noalias() = part * directions_[l].transpose() / coordinate_scale_[l];
    at += directions_[l].rows();
  }
  return out;
}

RowVector ModelSpace::decode(const RowVector& values) const {
  const Eigen::Index width = standardisation_.mean().size();
  if (options_.variant != Variant::kBasis) return standardisation_.restore(values.head(width));
  RowVector z = RowVector::Zero(width);
  Eigen::Index at = 0;
  for (size_t l = 0; l < directions_.size(); ++l) {
    const Token& token = standardisation_.tokens()[l];
    z.segment(static_cast<Eigen::Index>(token.begin), static_cast<Eigen::Index>(token.size)).noalias() =
        coordinate_scale_[l] * values.segment(at, directions_[l].rows()) * directions_[l];
    at += directions_[l].rows();
  }
  return standardisation_.restore(z);
}

}  // namespace figurine::generate
