// What the pose UNet's evaluations share, plain (unet.cpp) and fake-quantised
// (fake_quantisation.cpp): the network's shape, where its parameters lie in the flat tensor, and
// the steps that know nothing of weights. Not for others.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/network.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

// Where a convolution's parameters lie in the flat tensor: kernel [out,k,k,in], then bias [out].
struct ConvolutionSlot {
  int64_t weights = 0, bias = 0;
  int64_t in = 0, out = 0, kernel = 0;
  int64_t end() const { return bias + out; }
  std::vector<int64_t> padding() const { return {kernel / 2, kernel / 2}; }
};

// The network's shape; shared with the graph's nodes.
struct UNetPlan : torch::CustomClassHolder {
  Network network;  // without weights
  std::vector<ValueShape> shapes;
  std::vector<ConvolutionSlot> slots;  // [layers]; meaningful for convolutions
  int64_t parameters = 0;
  Precision precision = Precision::kBfloat16;

  bool is_head(size_t layer) const { return layer + 1 == network.layers.size(); }
  // The head stays in float, whatever the other convolutions do.
  torch::ScalarType type_of(size_t layer) const {
    return precision == Precision::kBfloat16 && !is_head(layer) ? torch::kBFloat16 : torch::kFloat;
  }
  // A view of flat as [out,in,k,k] in channels-last strides: no copy.
  static torch::Tensor kernel_of(const torch::Tensor& flat, const ConvolutionSlot& slot) {
    return flat.narrow(0, slot.weights, slot.bias - slot.weights)
        .view({slot.out, slot.kernel, slot.kernel, slot.in})
        .permute({0, 3, 1, 2});
  }
  static torch::Tensor bias_of(const torch::Tensor& flat, const ConvolutionSlot& slot) {
    return flat.narrow(0, slot.bias, slot.out);
  }
};

// [T,T,C] seen as [1,C,T,T] in channels-last strides. By view and permute: unsqueeze would give the
// batch a stride that is not recognised as channels-last, and the convolutions would take their
// slow path.
inline torch::Tensor as_channels_last(const torch::Tensor& t) {
  return t.view({1, t.size(0), t.size(1), t.size(2)}).permute({0, 3, 1, 2});
}
// And back: [1,C,T,T] to contiguous [T,T,C].
inline torch::Tensor as_rows(const torch::Tensor& t) {
  return t.permute({0, 2, 3, 1}).squeeze(0).contiguous();
}

// A 1x1 convolution sees its pixels as a batch of 16: for batch 1 on one thread LibTorch would
// leave oneDNN for a BLAS call.
torch::Tensor batched(const torch::Tensor& t, const ConvolutionSlot& slot);
torch::Tensor unbatched(const torch::Tensor& t, const torch::Tensor& like);

// Gradients of all values on the way back. A value that several layers read gets the sum of their
// gradients; the layers run in reverse, so it is complete when its own layer comes.
class ValueGradients {
 public:
  explicit ValueGradients(size_t values) : gradients_(values) {}
  void give(uint32_t value, torch::Tensor gradient) {
    gradients_[value] =
        gradients_[value].defined() ? gradients_[value].add_(gradient) : std::move(gradient);
  }
  torch::Tensor take(size_t value) { return std::move(gradients_[value]); }

 private:
  std::vector<torch::Tensor> gradients_;
};

// Max pool, upsample and concatenation backwards. a: the layer's first input; pooled: the indices
// of max_pool2d_with_indices.
void give_back(const Layer& layer, const torch::Tensor& gradient, const torch::Tensor& a,
               const torch::Tensor& pooled, ValueGradients& gradients);

}  // namespace figurine::model
