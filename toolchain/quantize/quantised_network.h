// A float network and its scales to a network in fixed point.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "figurine/detail/fixed_point_weights.h"
#include "figurine/fixed_point.h"
#include "figurine/network.h"

namespace figurine::model {
struct FakeQuantisation;
class PoseUNet;
}  // namespace figurine::model

namespace figurine::quantize {

// Which values have to share one scale: max pool, upsample and concatenation hand on integers as
// they are, so their inputs and outputs are one group. [layers + 1] the smallest value of each
// value's group.
std::vector<uint32_t> scale_groups(const Network& network);

// All that calibration decides.
struct Scales {
  std::vector<Quantisation> values;              // [layers] value 0 first
  std::vector<std::vector<float>> weight_scale;  // [layers][out]; empty for layers without weights
};

enum class WeightRange : uint8_t { kMaxAbs, kSmallestError };

// One scale per output of every convolution. A scale is raised above its range's where fixed point
// needs it: all-zero weights, a bias that is large against the weights, a multiplier below 2^-32.
// network: with weights.
std::vector<std::vector<float>> choose_weight_scales(const Network& network,
                                                     const std::vector<Quantisation>& values,
                                                     WeightRange range);

// Weights and biases in integers, with their scales. Owns what FixedPointNetwork borrows.
class QuantisedNetwork {
 public:
  // Throws InputError if the result is not sound (validate_fixed_point). network: with weights.
  QuantisedNetwork(const Network& network, const Scales& scales);

  // Borrows from this object.
  FixedPointNetwork view() const { return storage_.view(); }
  const std::vector<Quantisation>& values() const { return values_; }

 private:
  std::vector<Quantisation> values_;
  FixedPointStorage storage_;
};

// Makes the UNet imitate a network in fixed point, a package's for example: its weights become the
// integers' real values. Throws InputError if it is another shape's.
void imitate(const FixedPointNetwork& fixed, model::PoseUNet& unet);

// The same arithmetic in the trainer's UNet, everything rounded.
std::shared_ptr<model::FakeQuantisation> fake_quantisation(const Scales& scales);

}  // namespace figurine::quantize
