// Convolutions whose result depends on their inputs alone.
//
// Where activations lie channel by channel (torch's usual order), oneDNN's AVX-512 kernels work on
// copies in blocks of 16 channels. Debian 13's library leaves what fills the last block
// uninitialised if the channels are no multiple of 16: multiplied by zero it does no harm, unless
// the memory holds a NaN or an infinity, which then is the result's. Kernels for channels-last
// tensors have no such blocks.
#pragma once

#include "toolchain/tensor_operations.h"

namespace figurine::model {

// x: [B,I,H,W], weight: [O,I,k,k]; the result is channels-last. bias: [O].
inline torch::Tensor conv2d(const torch::Tensor& x, const torch::Tensor& weight,
                            const torch::Tensor& bias, int64_t stride, int64_t padding) {
  return torch::conv2d(x.contiguous(at::MemoryFormat::ChannelsLast), weight, bias, stride, padding);
}

// weight: [I,O,k,k].
inline torch::Tensor conv_transpose2d(const torch::Tensor& x, const torch::Tensor& weight,
                                      const torch::Tensor& bias, int64_t stride, int64_t padding) {
  return torch::conv_transpose2d(x.contiguous(at::MemoryFormat::ChannelsLast), weight, bias, stride,
                                 padding);
}

}  // namespace figurine::model
