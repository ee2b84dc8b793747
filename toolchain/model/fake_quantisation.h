// Fake quantisation: fixed point (figurine/fixed_point.h) imitated in float, with gradients.
//
// Values and weights are held in integer units, q - zero point and weight / scale. So every
// rounding is that of the integers, and the sums of int8 convolutions are exact in float as long as
// they stay below 2^24; only the first layer's sums over the int16 input are rounded. Rounding can
// be switched off layer by layer: without any, this is the float network in other units.
//
// Gradients are straight-through: rounding counts as the identity, clipping passes nothing where it
// clips.
//
// Based on: Jacob et al., Quantization and Training of Neural Networks for Efficient
// Integer-Arithmetic-Only Inference, 2018, section 3; Bengio et al., Estimating or Propagating
// Gradients Through Stochastic Neurons for Conditional Computation, 2013, section 3.4.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "figurine/fixed_point.h"
#include "toolchain/tensor.h"

namespace figurine::model {

struct UNetPlan;

struct FakeQuantisation {
  std::vector<Quantisation> values;  // [layers] value 0 first, as in FixedPointNetwork; pool,
                                     // upsample and concat share theirs
  std::vector<torch::Tensor>
      weight_scale;                 // [layers] float [out]; undefined for layers without weights
  std::vector<bool> round_weights;  // [layers] and biases
  bool round_biases = true;         // false: biases stay float everywhere
  std::vector<bool> round_value;    // [layers] value 0 first: rounding and clipping
  int32_t input_max = kInputMax;    // of value 0; 127 imitates an int8 input
  // Dynamic quantisation as XNNPACK's qd8_f32_qc8w: every convolution's input by its own range,
  // found in this very evaluation; other values are not rounded (round_value is not read). No
  // gradient through it.
  bool dynamic_ranges = false;
};

// TORCH_CHECKs that everything has the network's shape.
void check_fake_quantisation(const FakeQuantisation& quantisation, const UNetPlan& plan);

// PoseUNet::forward and PoseUNet::evaluate_values.
torch::Tensor run_fake_quantised(const torch::Tensor& flat, const torch::Tensor& input,
                                 const c10::intrusive_ptr<UNetPlan>& plan,
                                 const std::shared_ptr<const FakeQuantisation>& quantisation);
std::vector<torch::Tensor> fake_quantised_values(const torch::Tensor& flat,
                                                 const torch::Tensor& input, const UNetPlan& plan,
                                                 const FakeQuantisation& quantisation);

}  // namespace figurine::model
