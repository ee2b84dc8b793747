// The trainer's optimiser over one flat tensor of weights: Muon for the kernels of the hidden
// convolutions, AdamW for the biases and the head, whose rows mean different things; or AdamW for
// all, as in the paper.
//
// Based on: Loshchilov & Hutter, Decoupled Weight Decay Regularization, 2019, algorithm 2 (AdamW);
// Jordan et al., Muon, 2024; Liu et al., Muon is Scalable for LLM Training, 2025, eq. 4 (the size
// of Muon's step, so that both share one learning rate).
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/tensor.h"

namespace figurine::model {

// A stretch of the flat tensor that is updated by one rule.
struct ParameterGroup {
  int64_t begin = 0, end = 0;
  int64_t matrix_rows =
      0;  // Muon, on a matrix [matrix_rows, (end - begin) / matrix_rows]; 0: AdamW
};

struct OptimiserOptions {
  double beta1 = 0.9, beta2 = 0.999;  // AdamW's
  double epsilon = 1e-10;     // AdamW's; 1e-8 may swallow the small gradients of a mean loss
  double weight_decay = 0.0;  // of both
  double momentum = 0.95;     // Muon's, after Nesterov
};

class Optimiser {
 public:
  // The groups must cover [0, parameters) in order, without a gap.
  Optimiser(std::vector<ParameterGroup> groups, const OptimiserOptions& options);

  // weights and gradients: [P] contiguous floats. A gradient that is not finite leaves everything
  // as it was and returns false. A matrix of Muon's without any gradient stays where it is.
  bool step(torch::Tensor& weights, const torch::Tensor& gradients, double learning_rate);

  // State for checkpoints: moments [P] and the number of steps. Muon's groups keep their momentum
  // in the first and leave the second zero.
  torch::Tensor first_moment, second_moment;
  int64_t steps = 0;

 private:
  void step_adamw(const ParameterGroup& group, float* weights, const float* gradients,
                  double learning_rate);
  void step_muon(const ParameterGroup& group, torch::Tensor& weights,
                 const torch::Tensor& gradients, double learning_rate);

  std::vector<ParameterGroup> groups_;
  OptimiserOptions options_;
};

// Of all values together, in double. Not finite exactly where one of [P] contiguous floats is not.
double squared_norm(const torch::Tensor& gradients);

// One group for all of `parameters`: AdamW.
std::vector<ParameterGroup> adamw_group(uint64_t parameters);

}  // namespace figurine::model
