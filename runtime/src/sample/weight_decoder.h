// Sampled values to the weights of an avatar: w = mean + sum over k of (x_k * scale_k) * q_k, token
// by token, k rising, every operation rounded in float. The same bits on every CPU.
#pragma once

#include <span>

#include "figurine/sampler.h"

namespace figurine {

// x: [D]; weights: [W].
void decode_weights(const Sampler& sampler, std::span<const double> x, std::span<float> weights);

}  // namespace figurine
