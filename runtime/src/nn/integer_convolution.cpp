#include "runtime/src/nn/integer_convolution.h"

#include <algorithm>

namespace figurine {

bool PaddedMap::ensure(uint32_t size, uint32_t channels) {
  size_ = size;
  stride_ = stride_of(channels);
  return values_.ensure(size_t(size + 2) * (size + 2) * stride_);
}

bool IntegerConvolution::prepare(const KernelTable& kernels, const Layer& layer,
                                 const FixedPointConvolution& convolution, const ValueShape& input,
                                 uint32_t varying, std::span<const int16_t> constants) {
  size_ = input.size;
  kernel_ = layer.kernel;
  varying_ = varying;
  outputs_ = layer.out_channels;
  stride_ = PaddedMap::stride_of(varying);
  const size_t taps = size_t{kernel_} * kernel_;
  length_ = taps * stride_;
  padded_outputs_ =
      (outputs_ + kernels::kDotsAtOnce - 1) / kernels::kDotsAtOnce * kernels::kDotsAtOnce;
  if (!weights_.ensure(padded_outputs_ * length_)) return false;
  for (size_t row = 0; row < outputs_ * taps; ++row) {
    std::copy_n(convolution.weights.data() + row * input.channels, varying,
                weights_.data() + row * stride_);
  }
  one_bias_ = varying == input.channels;
  if (!one_bias_) return fold(kernels, layer, convolution, input.channels, constants);
  if (!bias_.ensure(padded_outputs_)) return false;
  std::copy(convolution.bias.begin(), convolution.bias.end(), bias_.data());
  return true;
}

bool IntegerConvolution::fold(const KernelTable& kernels, const Layer& layer,
                              const FixedPointConvolution& convolution, uint32_t in_channels,
                              std::span<const int16_t> constants) {
  const uint32_t count = in_channels - varying_;
  const size_t texels = size_t{size_} * size_, taps = size_t{kernel_} * kernel_;
  if (!bias_.ensure(texels * padded_outputs_)) return false;

  // The same convolution over the constant channels alone, as if they varied.
  IntegerConvolution rest;
  PaddedMap map;
  Buffer<int8_t> weights;
  if (!weights.ensure(outputs_ * taps * count)) return false;
  for (size_t row = 0; row < outputs_ * taps; ++row) {
    std::copy_n(convolution.weights.data() + row * in_channels + varying_, count,
                weights.data() + row * count);
  }
  const FixedPointConvolution of_constants{.weights = weights.span(outputs_ * taps * count),
                                           .weight_scale = convolution.weight_scale,
                                           .bias = convolution.bias};
  if (!map.ensure(size_, count) ||
      !rest.prepare(kernels, layer, of_constants, {size_, count}, count, {}))
    return false;
  for (uint32_t y = 0; y < size_; ++y) {
    for (uint32_t x = 0; x < size_; ++x) {
      std::copy_n(constants.data() + (size_t{y} * size_ + x) * count, count,
                  map.row(static_cast<int32_t>(y)) + x * map.stride());
    }
  }
  Buffer<int16_t> patch;
  if (!patch.ensure(rest.patch_length())) return false;
  for (uint32_t y = 0; y < size_; ++y) {
    for (uint32_t x = 0; x < size_; ++x) {
      rest.gather(map, x, y, patch.data());
      rest.sum(kernels, patch.data(), x, y, &bias_[(size_t{y} * size_ + x) * padded_outputs_]);
    }
  }
  return true;
}

void IntegerConvolution::gather(const PaddedMap& map, uint32_t x, uint32_t y,
                                int16_t* patch) const {
  const int32_t reach = static_cast<int32_t>(kernel_ / 2);
  const size_t row_length = kernel_ * stride_;
  for (int32_t ky = -reach; ky <= reach; ++ky) {
    const int16_t* from = map.row(static_cast<int32_t>(y) + ky) +
                          (ptrdiff_t{x} - reach) * static_cast<ptrdiff_t>(stride_);
    for (size_t k = 0; k < row_length; k += kernels::kDotMultiple)
      std::copy_n(from + k, kernels::kDotMultiple, patch + k);
    patch += row_length;
  }
}

void IntegerConvolution::gather(const int8_t* map, int32_t zero_point, uint32_t x, uint32_t y,
                                int16_t* patch) const {
  const int32_t reach = static_cast<int32_t>(kernel_ / 2), size = static_cast<int32_t>(size_);
  for (int32_t row = static_cast<int32_t>(y) - reach; row <= static_cast<int32_t>(y) + reach;
       ++row) {
    for (int32_t column = static_cast<int32_t>(x) - reach;
         column <= static_cast<int32_t>(x) + reach; ++column, patch += stride_) {
      if (row < 0 || row >= size || column < 0 || column >= size) {
        std::fill_n(patch, varying_, int16_t{0});
        continue;
      }
      const int8_t* from = map + (size_t(row) * size_ + size_t(column)) * varying_;
      for (uint32_t c = 0; c < varying_; ++c) patch[c] = static_cast<int16_t>(from[c] - zero_point);
    }
  }
}

void IntegerConvolution::sum(const KernelTable& kernels, const int16_t* patch, uint32_t x,
                             uint32_t y, int32_t* sums) const {
  const int32_t* bias = bias_.data() + (one_bias_ ? 0 : (size_t{y} * size_ + x) * padded_outputs_);
  std::copy_n(bias, padded_outputs_, sums);
  kernels.add_dots({.shared = patch,
                    .rows = weights_.data(),
                    .length = length_,
                    .count = padded_outputs_,
                    .sums = sums});
}

}  // namespace figurine
