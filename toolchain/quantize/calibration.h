// Which ranges a trained network's values take on its training poses, and the scales chosen from
// them. Held-out poses are never looked at.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/quantize/quantised_network.h"
#include "toolchain/quantize/range.h"
#include "toolchain/tensor.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::quantize {

enum class RangeMethod : uint8_t { kMinMax, kPercentile, kSmallestError };

struct CalibrationOptions {
  RangeMethod method = RangeMethod::kSmallestError;
  double percentile = 99.99;  // of kPercentile
  WeightRange weights = WeightRange::kMaxAbs;
  uint32_t poses = 64;  // spread over the training poses; fewer if there are fewer
};

std::string describe(const CalibrationOptions& options);

// What the float network's values did.
struct ActivationStatistics {
  std::vector<uint32_t> group;        // scale_groups
  std::vector<Histogram> histograms;  // [layers + 1] of a group at its smallest value, empty
                                      // elsewhere; value 0 and the result have none
  float input_max = 0;                // largest magnitude of value 0
  uint32_t poses = 0;                 // looked at
};

// Runs the model in float. Only convolutions' outputs are counted: pool, upsample and concatenation
// add no larger ones. Throws InputError if there is no training pose.
ActivationStatistics observe_activations(train::TrainedAvatar& avatar, uint32_t poses);

// Counts one evaluation, value 0 first, as PoseUNet::evaluate_values gives it in float. group: as
// scale_groups of the network has them.
void count_values(const Network& network, const std::vector<torch::Tensor>& values,
                  ActivationStatistics& statistics);

// The scales of the values alone. network: shapes.
std::vector<Quantisation> choose_value_scales(const Network& network,
                                              const ActivationStatistics& statistics,
                                              const CalibrationOptions& options);

// network: of the same model, with weights.
Scales choose_scales(const Network& network, const ActivationStatistics& statistics,
                     const CalibrationOptions& options);

// Tensors values.scale, values.zero_point and layer.N.weight_scale in a safetensors file: a
// fine-tuned network belongs to its scales.
void save_scales(const std::string& path, const Scales& scales);
// Throws InputError if they are not a network's of this shape.
Scales load_scales(const std::string& path, const Network& network);

}  // namespace figurine::quantize
