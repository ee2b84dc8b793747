// A network that stays and a residual of low rank beside it: every kernel, seen as a matrix [out,
// k*k*in], is the given one plus A B with A [out,r] and B [r,k*k*in]. Only the factors learn. B is
// zero at first, so that training starts at the given network; biases stay.
//
// The sum is written into the network's own weights, so whatever reads those, files, evaluation
// and packages, knows nothing of factors.
//
// Based on: Hu et al., LoRA: Low-Rank Adaptation of Large Language Models, 2022, section 4.1.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/model/unet.h"
#include "toolchain/tensor.h"

namespace figurine::model {

class LowRankResidual {
 public:
  // rank: of every kernel, where both of its sides are as long. A is uniform of variance 1 / rank,
  // which makes a step of AdamW on B move a weight as far as a step on the weight itself. seed: the
  // same numbers on every machine.
  LowRankResidual(const PoseUNet& network, uint32_t rank, uint64_t seed);

  // [P] float: the network that stays. Whoever loads another writes it here.
  torch::Tensor& base() { return base_; }
  const torch::Tensor& base() const { return base_; }
  // [Q] float, layer after layer A, then B, by rows.
  torch::Tensor& factors() { return factors_; }
  const torch::Tensor& factors() const { return factors_; }

  // weights [P] become the base's with A B added to the kernels.
  void fold_into(torch::Tensor& weights) const;
  // [Q] dL/dfactors from [P] dL/dweights.
  torch::Tensor gradients(const torch::Tensor& by_weights) const;

 private:
  struct Slot {
    KernelMatrix kernel;
    int64_t rank = 0, a = 0, b = 0;  // where A and B begin in the factors
  };
  torch::Tensor a_of(const torch::Tensor& factors, const Slot& slot) const;
  torch::Tensor b_of(const torch::Tensor& factors, const Slot& slot) const;

  std::vector<Slot> slots_;  // of the convolutions
  torch::Tensor base_, factors_;
};

}  // namespace figurine::model
