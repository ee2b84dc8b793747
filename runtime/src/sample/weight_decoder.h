// Sampled values to the weights of an avatar: w = mean + sum over k of (x_k * scale_k) * q_k, token
// by token, k rising, every operation rounded in float. The same bits on every CPU.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/sampler.h"

namespace figurine {

// x: [D]; weights: [W].
void decode_weights(const Sampler& sampler, std::span<const double> x, std::span<float> weights);

// The values of the patches, the last of the weights, to the static part's integers, whose room
// this is: q = clamp(round(w / scale), -127, 127), each cell where its row says.
StaticPart decode_static_part(const Sampler& sampler, std::span<const float> patches,
                              std::vector<int8_t>& integers);

}  // namespace figurine
