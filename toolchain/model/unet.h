// The pose UNet as a trainable module, built from figurine::Network (make_pose_unet).
//
// All weights live in one flat float tensor, layer after layer: kernel [out,k,k,in] (OHWI, as the
// package stores it), then bias. One token of the sampler is one layer's stretch of it.
// Convolutions run channels-last, in bf16 if asked for (the head stays in float).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "figurine/network.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/tensor.h"

namespace figurine::model {

struct FakeQuantisation;  // fake_quantisation.h

enum class Precision : uint8_t { kFloat32, kBfloat16 };

struct PoseUNetOptions {
  Precision precision = Precision::kBfloat16;  // of the convolutions' arithmetic; weights,
                                               // gradients and the head stay float
  uint64_t seed = 0;                           // of the initial weights: the same on every machine
  float head_weight_factor = 0.1f;             // He initialisation, the head's weights times this
  float rgb_bias =
      0.3f;  // initial bias of the head's three SH degree 0 channels; all other biases are zero
};

// Where a convolution's kernel lies in the flat weights: [rows, columns] = [out, k*k*in].
struct KernelMatrix {
  int64_t begin = 0, rows = 0, columns = 0;
};

class PoseUNet {
 public:
  // network: shapes only (its weights, if any, are not read). Throws InputError if it is unsound.
  PoseUNet(const Network& network, const PoseUNetOptions& options);
  ~PoseUNet();

  // input: [T,T,Cin] float, contiguous. Returns the raw head output [T,T,Cout] float, contiguous,
  // differentiable by the weights (not by the input).
  torch::Tensor forward(const torch::Tensor& input);

  // Every value of one evaluation, value 0 first: [1,C,H,W] in channels-last strides, without
  // gradient. In integer units (q - zero point) with fake quantisation, but for the last, which is
  // real.
  std::vector<torch::Tensor> evaluate_values(const torch::Tensor& input) const;

  // From now on forward() and evaluate_values() imitate fixed point; null: plain again. Needs
  // Precision::kFloat32. Never changes weights.
  void set_fake_quantisation(std::shared_ptr<const FakeQuantisation> quantisation);

  torch::Tensor& weights();  // [P] flat float; a leaf that requires a gradient
  const torch::Tensor& weights() const;
  torch::Tensor&
  gradients();  // [P] flat float; backward passes add to it, undefined before the first
  void zero_gradients();

  // From now on this UNet's weights are the other's, in the same memory; gradients stay its own.
  // Throws if the shapes differ.
  void share_weights(const PoseUNet& other);

  uint64_t parameter_count() const;
  std::vector<uint64_t> token_lengths() const;  // per convolution: kernel + bias
  // Where Muon and AdamW each update: kernels but the head's are matrices [out, k*k*in].
  std::vector<ParameterGroup> muon_groups() const;
  std::vector<KernelMatrix> kernels() const;  // of all convolutions, the head's last

  // The network with weights: spans into `storage`, which is filled with a copy of the flat
  // weights.
  Network export_network(std::vector<float>& storage) const;
  // Throws InputError if the shapes differ.
  void import_network(const Network& network);

 private:
  void check_input(const torch::Tensor& input) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace figurine::model
