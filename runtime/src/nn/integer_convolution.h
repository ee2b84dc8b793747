// A convolution of a network in fixed point, evaluated texel by texel to its exact int32 sums: for
// the two ends of the network, where XNNPACK has no operator (int16 in; float out on some texels
// alone).
//
// Weights and the values under the kernel lie side by side as int16, so that a sum is a dot product
// of two arrays: compilers make pmaddwd (SSE2) or smlal (NEON) of it. Integer sums are exact, so
// any order gives the same bits; validate_fixed_point says that none overflows.
//
// Based on: Chellapilla, Puri, Simard, High Performance Convolutional Neural Networks for Document
// Processing, 2006 (unrolled patches).
#pragma once

#include <cstdint>
#include <span>

#include "figurine/fixed_point.h"
#include "figurine/network.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/table.h"

namespace figurine {

// An int16 map with a border of one texel of zeros all around, channels rounded up to a multiple of
// 8 by zeros.
class PaddedMap {
 public:
  static uint32_t stride_of(uint32_t channels) { return (channels + 7) / 8 * 8; }

  bool ensure(uint32_t size, uint32_t channels);
  uint32_t stride() const { return stride_; }
  // Row y without its border; y = -1 and y = size are border rows.
  int16_t* row(int32_t y) { return values_.data() + offset(y); }
  const int16_t* row(int32_t y) const { return values_.data() + offset(y); }
  uint64_t memory_bytes() const { return values_.memory_bytes(); }

 private:
  size_t offset(int32_t y) const { return (size_t(y + 1) * (size_ + 2) + 1) * stride_; }

  uint32_t size_ = 0, stride_ = 0;
  Buffer<int16_t> values_;
};

class IntegerConvolution {
 public:
  // The layer reads maps of size x size texels of in_channels channels, of which the first
  // `varying` are given to every evaluation and the others, constants, once: [size,size,in_channels
  // - varying]. What these add is folded into a map of biases. False without memory.
  bool prepare(const KernelTable& kernels, const Layer& layer,
               const FixedPointConvolution& convolution, const ValueShape& input, uint32_t varying,
               std::span<const int16_t> constants);

  uint32_t outputs() const { return outputs_; }
  size_t patch_length() const {
    return length_;
  }  // int16 values that a caller's patch has room for
  size_t sums_length() const {
    return padded_outputs_;
  }  // int32 values that a caller's sums have room for

  // The values under the kernel at (x, y), outside the image zero in reals. patch: aligned to 16
  // bytes.
  void gather(const PaddedMap& map, uint32_t x, uint32_t y, int16_t* patch) const;
  void gather(const int8_t* map, int32_t zero_point, uint32_t x, uint32_t y,
              int16_t* patch) const;  // [size,size,in_channels]

  // All outputs' sums at (x, y), bias and constants included.
  void sum(const KernelTable& kernels, const int16_t* patch, uint32_t x, uint32_t y,
           int32_t* sums) const;

  uint64_t memory_bytes() const { return weights_.memory_bytes() + bias_.memory_bytes(); }

 private:
  bool fold(const KernelTable& kernels, const Layer& layer,
            const FixedPointConvolution& convolution, uint32_t in_channels,
            std::span<const int16_t> constants);

  uint32_t size_ = 0, kernel_ = 0, varying_ = 0, outputs_ = 0;
  size_t stride_ = 0, length_ = 0, padded_outputs_ = 0;
  bool one_bias_ = true;     // for all texels: no channel is constant
  Buffer<int16_t> weights_;  // [padded_outputs,kernel,kernel,stride]
  Buffer<int32_t> bias_;     // [padded_outputs], or [size,size,padded_outputs]
};

}  // namespace figurine
