// The arithmetic of LPIPS on a network's activations, for any network: d = sum_l (1 / H_l W_l) sum_hw |sqrt(w_l) (y_hw - y'_hw)|^2 with y
// the activations of a layer, normalised at every position over its channels.
//
// Based on: Zhang et al., 2018, eq. 1; the constant under the norm is that of the authors' code (1e-10).
#pragma once

#include <torch/torch.h>

#include <vector>

#include "toolchain/evaluate/feature_network.h"

namespace figurine::evaluate {

// Layer by layer sqrt(w / (H W)) y, one after the other: distances are squared Euclidean ones between these. activations: [1,C,H,W] each;
// channel_weights: [C] each, none negative.
std::vector<float> perceptual_embedding(const std::vector<torch::Tensor>& activations, const std::vector<torch::Tensor>& channel_weights);

// The summands of the distance with w = 1, one a layer.
std::vector<double> layer_distances(const std::vector<torch::Tensor>& a, const std::vector<torch::Tensor>& b);

// [1,3,H,W], a view.
torch::Tensor to_tensor(const RgbView& picture);

}  // namespace figurine::evaluate
