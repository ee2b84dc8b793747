// AdamW over one flat tensor, in one pass over its values.
//
// Based on: Loshchilov & Hutter, Decoupled Weight Decay Regularization, 2019, algorithm 2.
#pragma once

#include <torch/torch.h>

#include <cstdint>

namespace figurine::model {

struct AdamWOptions {
  double beta1 = 0.9, beta2 = 0.999;
  double epsilon = 1e-10;  // 1e-8 may swallow the small gradients of a mean loss
  double weight_decay = 0.0;
};

class AdamW {
 public:
  AdamW(uint64_t parameters, const AdamWOptions& options);

  // weights and gradients: [P] contiguous floats. A gradient that is not finite leaves everything as it was and returns false.
  bool step(torch::Tensor& weights, const torch::Tensor& gradients, double learning_rate);

  // State for checkpoints: first and second moments [P] and the number of steps.
  torch::Tensor first_moment, second_moment;
  int64_t steps = 0;

 private:
  AdamWOptions options_;
};

}  // namespace figurine::model
