// The arithmetic of LPIPS on a network's activations, for any network: d = sum_l (1 / H_l W_l)
// sum_hw |sqrt(w_l) (y_hw - y'_hw)|^2 with y = a / (|a| + e_l) the activations of a layer,
// normalised at every position over its channels. LPIPS' own e is 1e-10 for all layers: where a
// network sees next to nothing it divides noise by noise. Networks of our own have an e_l that
// means something.
//
// Based on: Zhang et al., 2018, eq. 1, and the authors' code (e under the norm).
#pragma once

#include <vector>

#include "toolchain/features/feature_network.h"
#include "toolchain/tensor.h"

namespace figurine::features {

inline constexpr double kLpipsFloor = 1e-10;  // e of LPIPS

// How a layer's activations count.
struct LayerWeights {
  torch::Tensor channels;      // [C], none negative
  double floor = kLpipsFloor;  // e_l, above 0
};

// Layer by layer sqrt(w / (H W)) y, one after the other: distances are squared Euclidean ones
// between these. activations: [1,C,H,W] each.
std::vector<float> perceptual_embedding(const std::vector<torch::Tensor>& activations,
                                        const std::vector<LayerWeights>& weights);

// The distance itself, a scalar, for losses: differentiable by both pictures, whose activations are
// [2,C,H,W] each. Two pictures at once, because LibTorch leaves oneDNN for BLAS, and BLAS's
// threads, where one alone is small. Where a position's activations are all zero, nothing is passed
// on.
torch::Tensor perceptual_distance(const std::vector<torch::Tensor>& activations,
                                  const std::vector<LayerWeights>& weights);

// Mean over the positions of |a|, one a layer.
std::vector<double> layer_norms(const std::vector<torch::Tensor>& activations);

// The summands of the distance with w = 1, one a layer. floors: [layers].
std::vector<double> layer_distances(const std::vector<torch::Tensor>& a,
                                    const std::vector<torch::Tensor>& b,
                                    const std::vector<double>& floors);

// [1,3,H,W], a view.
torch::Tensor to_tensor(const RgbView& picture);

}  // namespace figurine::features
