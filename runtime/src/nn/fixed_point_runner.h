// Evaluates a figurine::Network in fixed point, equal to evaluate_fixed_point to the bit on every
// CPU and any number of threads.
//
//   input [T,T,C] float -> int16 -> first convolutions (our own) -> int8 -> XNNPACK (qs8, qc8w) ->
//       int8 -> last convolution (our own) ->
//   float
//
// XNNPACK has neither int16 inputs nor int32 results, hence our own convolutions at both ends. They
// leave out what cannot matter: constant channels of the input are folded once into a map of
// biases, a texel whose neighbourhood nothing is ever drawn into keeps the one result it has, and
// the last layer is evaluated on the texels that are wanted alone.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "figurine/fixed_point.h"
#include "figurine/network.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/nn/integer_convolution.h"
#include "runtime/src/nn/xnnpack_runtime.h"

namespace figurine {

// How the network is going to be used. Texels are v * size + u.
struct FixedPointUse {
  uint32_t varying_channels = 0;     // of the input, the first ones; the others are constant:
  std::span<const float> constants;  // [T,T,C - varying_channels]
  std::span<const uint32_t> drawn;   // input texels whose varying channels may be other than zero
  std::span<const uint32_t> wanted;  // texels of the result; must outlive the runner
};

class FixedPointRunner {
 public:
  // The network's weights are read here and not afterwards. The pool must outlive the runner.
  // Errors: kCorrupt of validate_fixed_point; kUnsupported where XNNPACK cannot run at all or not
  // this network; kOutOfMemory.
  static Result<std::unique_ptr<FixedPointRunner>> create(
      const Network& network, const FixedPointNetwork& fixed, const FixedPointUse& use,
      ThreadPool& pool, const KernelTable& kernels = best_kernels());
  FixedPointRunner(const FixedPointRunner&) = delete;
  FixedPointRunner& operator=(const FixedPointRunner&) = delete;

  // [T,T,input_stride()], kept between runs. The first varying_channels of each texel are read;
  // they must be zero where nothing is drawn.
  std::span<float> input() { return input_.span(input_count_); }
  uint32_t input_stride() const { return map_.stride(); }
  std::span<const float> output() const {
    return output_.span(wanted_.size() * head_.outputs());
  }  // [wanted,channels]

  // Evaluates all wanted texels, or the groups of them that are named: of kWantedGroup each, in the
  // order of FixedPointUse::wanted. The other outputs keep what they have.
  static constexpr uint32_t kWantedGroup = 16;
  Status run();
  Status run(std::span<const uint32_t> groups);
  // Further groups of the last run: its input's, whatever the input holds by now.
  void run_further(std::span<const uint32_t> groups);

  uint64_t macs() const { return macs_; }
  uint64_t memory_bytes() const;  // XNNPACK's share is estimated

 private:
  // A convolution that reads the input and gives int8.
  struct FirstConvolution {
    IntegerConvolution sums;
    uint32_t value = 0;        // that it makes
    Buffer<float> multiplier;  // [outputs]
    int32_t zero_point = 0, lowest = 0;
    Buffer<uint8_t> active;  // [T,T] 1 where the result follows the input
    Buffer<int8_t> output;   // [T,T,outputs]
  };

  FixedPointRunner(ThreadPool& pool, const KernelTable& kernels) : pool_(pool), kernels_(kernels) {}
  Status prepare(const Network& network, const FixedPointNetwork& fixed, const FixedPointUse& use,
                 const std::vector<ValueShape>& shapes);
  Status prepare_first(const Network& network, const FixedPointNetwork& fixed,
                       const FixedPointUse& use, size_t layer);
  Status prepare_middle(const Network& network, const FixedPointNetwork& fixed,
                        const std::vector<ValueShape>& shapes);
  Status prepare_head(const Network& network, const FixedPointNetwork& fixed,
                      const FixedPointUse& use, const ValueShape& input);
  Status prepare_scratch();

  void quantise_row(uint32_t y);
  enum class Texels : uint8_t { kOthers, kActive };
  void run_first(FirstConvolution& first, Texels texels, uint32_t y);
  void run_head(std::span<const uint32_t> groups, size_t task);

  ThreadPool& pool_;
  const KernelTable& kernels_;
  uint32_t size_ = 0;  // T
  size_t input_count_ = 0;
  float input_scale_ = 1;
  Buffer<float> input_;
  PaddedMap map_;  // the input in int16
  Buffer<int16_t> constants_;
  std::vector<FirstConvolution> first_;
  XnnRuntime runtime_;  // null if no layer is left for XNNPACK
  Buffer<int8_t> middle_;
  const int8_t* head_input_ = nullptr;  // null: the head reads the network's input
  IntegerConvolution head_;
  int32_t head_zero_point_ = 0;
  uint32_t head_size_ = 0;
  Buffer<float> head_scale_;  // [outputs]
  std::span<const uint32_t> wanted_;
  Buffer<uint32_t> all_groups_;  // 0, 1, 2, ...
  Buffer<float> output_;
  // One line each for every task of a loop.
  size_t patch_stride_ = 0, sums_stride_ = 0;
  Buffer<int16_t> patches_;
  Buffer<int32_t> sums_;
  uint64_t macs_ = 0, xnnpack_bytes_ = 0;
};

}  // namespace figurine
