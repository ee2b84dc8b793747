// The sampler's transformer on the device: from noisy values to clean ones, the same bits on every
// CPU.
//
// Equations as in toolchain/generate/transformer.h, which trained it: one projection a token, a
// time token of sinusoids of lambda, pre-norm blocks of attention and feed-forward, one projection
// back a token. Matrices are exact integer products (integer_linear.h); all else is float in a
// fixed order with functions of our own (docs/numerics.md, "Sampling on the device").
//
// Based on: the paper, section 4.2; Erkoc et al., HyperDiffusion, 2023; Radford et al., GPT-2, 2019
// (pre-norm blocks).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "figurine/sampler.h"
#include "figurine/status.h"
#include "runtime/src/sample/integer_linear.h"

namespace figurine {

class DeviceTransformer {
 public:
  // Borrows the sampler and its arrays, which must outlive it. kOutOfMemory.
  static Result<std::unique_ptr<DeviceTransformer>> create(
      const Sampler& sampler, const KernelTable& kernels = best_kernels());

  // z, x0: [D]. lambda: finite. Allocates nothing.
  void predict(std::span<const float> z, double lambda, std::span<float> x0);

  uint64_t memory_bytes() const;

 private:
  DeviceTransformer(const Sampler& sampler, const KernelTable& kernels);
  bool allocate();
  void multiply(const IntegerMatrix& matrix, const float* x, size_t rows, size_t x_stride, float* y,
                size_t y_stride);
  void embed(double lambda);
  void normalise(size_t which);
  void attend();

  const Sampler* sampler_;
  const KernelTable& kernels_;
  std::vector<IntegerMatrix> matrices_;  // in the order of denoiser_matrices
  std::vector<double> frequency_;        // [d / 2] turns a unit of lambda
  size_t tokens_ = 0;                    // L + 1, time first
  size_t width_ = 0;                     // d
  size_t padded_tokens_ = 0;             // row of keys_ and scores_

  RoundedRows rounded_;
  Buffer<int16_t> row_;       // one row of a matrix
  Buffer<float> token_;       // [tokens,d]
  Buffer<float> normed_;      // [tokens,d]
  Buffer<float> projected_;   // [tokens,max(3d,f)]
  Buffer<float> attended_;    // [tokens,d]
  Buffer<float> difference_;  // [tokens,d] what a branch adds
  Buffer<float> keys_;        // [d / heads,padded_tokens] of one head, transposed
  Buffer<float> scores_;      // [padded_tokens]
};

}  // namespace figurine
