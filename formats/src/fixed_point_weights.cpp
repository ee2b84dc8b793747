#include "figurine/detail/fixed_point_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "figurine/detail/double_math.h"

namespace figurine {

namespace {

constexpr float kLargestBias = 0x1p30f;          // steps; leaves half of int32 to the products
constexpr float kSmallestMultiplier = 0x1p-30f;  // XNNPACK's own limit is 2^-32

int8_t quantise_weight(float weight, float scale) {
  return static_cast<int8_t>(
      clamp_and_round(weight / scale, -float(kWeightMax), float(kWeightMax)));
}

// The float expressions of fake quantisation, so that the two agree. NaN gives the lowest.
int32_t quantise_bias(float bias, float input_scale, float weight_scale) {
  const float steps = bias / (weight_scale * input_scale);
  const float bounded = !(steps > -kLargestBias) ? -kLargestBias : std::min(steps, kLargestBias);
  return static_cast<int32_t>(double_math::round_small(bounded));
}

// Largest magnitude that the output's int32 sum can take.
double largest_sum(const OutputWeights& output, float scale) {
  const int32_t zero_point = output.input.zero_point;
  const double steps = output.reads_network_input
                           ? kInputMax
                           : std::max(kInt8Max - zero_point, zero_point - kInt8Min);
  double sum = std::abs(double(quantise_bias(output.bias, output.input.scale, scale)));
  for (const float weight : output.weights)
    sum += std::abs(int32_t{quantise_weight(weight, scale)}) * steps;
  return sum;
}

}  // namespace

float max_abs_scale(std::span<const float> weights) {
  float largest = 0;
  for (const float weight : weights) largest = std::max(largest, std::abs(weight));
  return largest / float(kWeightMax);
}

float raise_weight_scale(float scale, const OutputWeights& output) {
  scale = std::max(scale, kSmallestMultiplier * output.output_scale / output.input.scale);
  scale = std::max(scale, std::abs(output.bias) / (kLargestBias * output.input.scale));
  // Ends: with a large scale all weights are 0 steps, and the bias is at most 2^30; with an
  // infinite one validation refuses the network.
  while (std::isfinite(scale) && largest_sum(output, scale) > std::numeric_limits<int32_t>::max())
    scale *= 2;
  return scale;
}

Status FixedPointStorage::quantise(const Network& network, std::span<const Quantisation> values) {
  FIG_RETURN_IF_ERROR(infer_shapes(network, true).status());
  if (values.size() != network.layers.size())
    return Status(StatusCode::kInvalidArgument, "fixed point: not one scale per layer");
  std::vector<std::vector<float>> scales(network.layers.size());
  for (size_t i = 0; i < scales.size(); ++i) scales[i].reserve(network.layers[i].bias.size());
  for_each_output(network, values, [&](size_t layer, size_t, const OutputWeights& output) {
    scales[layer].push_back(raise_weight_scale(max_abs_scale(output.weights), output));
  });
  return quantise(network, values, std::move(scales));
}

Status FixedPointStorage::quantise(const Network& network, std::span<const Quantisation> values,
                                   std::vector<std::vector<float>> weight_scale) {
  FIG_RETURN_IF_ERROR(infer_shapes(network, true).status());
  if (values.size() != network.layers.size() || weight_scale.size() != network.layers.size()) {
    return Status(StatusCode::kInvalidArgument, "fixed point: not one scale per layer");
  }
  values_.assign(values.begin(), values.end());
  weight_scale_ = std::move(weight_scale);
  weights_.assign(network.layers.size(), {});
  bias_.assign(network.layers.size(), {});
  for (size_t i = 0; i < weights_.size(); ++i) {
    weights_[i].reserve(network.layers[i].weights.size());
    bias_[i].reserve(network.layers[i].bias.size());
  }
  for_each_output(network, values, [&](size_t layer, size_t o, const OutputWeights& output) {
    const float scale = weight_scale_[layer][o];
    for (const float weight : output.weights)
      weights_[layer].push_back(quantise_weight(weight, scale));
    bias_[layer].push_back(quantise_bias(output.bias, output.input.scale, scale));
  });
  return validate_fixed_point(network, view());
}

FixedPointNetwork FixedPointStorage::view() const {
  FixedPointNetwork network{.convolutions = {}, .values = values_};
  for (size_t i = 0; i < weights_.size(); ++i)
    network.convolutions.push_back({weights_[i], weight_scale_[i], bias_[i]});
  return network;
}

}  // namespace figurine
