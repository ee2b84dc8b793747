#include "toolchain/model/low_rank.h"

#include <algorithm>
#include <cmath>

#include "toolchain/random/split_mix.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

// A kernel's stretch of the flat weights, as a matrix; a view.
torch::Tensor matrix_of(const torch::Tensor& weights, const KernelMatrix& kernel) {
  return weights.narrow(0, kernel.begin, kernel.rows * kernel.columns)
      .view({kernel.rows, kernel.columns});
}

}  // namespace

LowRankResidual::LowRankResidual(const PoseUNet& network, uint32_t rank, uint64_t seed)
    : base_(network.weights().detach().clone()) {
  int64_t end = 0;
  for (const KernelMatrix& kernel : network.kernels()) {
    Slot slot{.kernel = kernel, .rank = std::min({int64_t{rank}, kernel.rows, kernel.columns})};
    slot.a = end;
    slot.b = slot.a + kernel.rows * slot.rank;
    end = slot.b + slot.rank * kernel.columns;
    slots_.push_back(slot);
  }
  factors_ = torch::zeros({end});
  float* const values = factors_.mutable_data_ptr<float>();
  random::SplitMix random(seed);
  for (const Slot& slot : slots_) {
    const float bound = std::sqrt(3.0f / static_cast<float>(slot.rank));
    for (int64_t i = slot.a; i < slot.b; ++i) values[i] = bound * random.signed_unit();
  }
}

torch::Tensor LowRankResidual::a_of(const torch::Tensor& factors, const Slot& slot) const {
  return factors.narrow(0, slot.a, slot.b - slot.a).view({slot.kernel.rows, slot.rank});
}

torch::Tensor LowRankResidual::b_of(const torch::Tensor& factors, const Slot& slot) const {
  return factors.narrow(0, slot.b, slot.rank * slot.kernel.columns)
      .view({slot.rank, slot.kernel.columns});
}

void LowRankResidual::fold_into(torch::Tensor& weights) const {
  const torch::NoGradGuard no_gradient;
  TORCH_CHECK(weights.numel() == base_.numel(), "LowRankResidual: weights of another network");
  weights.copy_(base_);
  for (const Slot& slot : slots_)
    matrix_of(weights, slot.kernel).add_(at::mm(a_of(factors_, slot), b_of(factors_, slot)));
}

torch::Tensor LowRankResidual::gradients(const torch::Tensor& by_weights) const {
  const torch::NoGradGuard no_gradient;
  TORCH_CHECK(by_weights.numel() == base_.numel(), "LowRankResidual: gradients of another network");
  torch::Tensor out = torch::empty_like(factors_);
  for (const Slot& slot : slots_) {
    const torch::Tensor by_kernel = matrix_of(by_weights, slot.kernel);
    a_of(out, slot).copy_(at::mm(by_kernel, b_of(factors_, slot).t()));
    b_of(out, slot).copy_(at::mm(a_of(factors_, slot).t(), by_kernel));
  }
  return out;
}

}  // namespace figurine::model
