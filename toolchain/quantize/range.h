// From the values that a network's activations took to the range that int8 shall cover.
//
//   min/max     everything that was seen; one outlier makes every step coarser
//   percentile  all but the outermost share at either end, zeros counted
//   MSE         the share of min/max whose squared error, rounding plus clipping, is smallest over
//   the histogram
// All ranges contain zero, so that zero is exact: padding and ReLU write it.
//
// Based on: Krishnamoorthi, Quantizing Deep Convolutional Networks for Efficient Inference, 2018;
// Sung et al., Resiliency of Deep Neural Networks under Quantization, 2015 (the search for the
// smallest squared error).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/fixed_point.h"

namespace figurine::quantize {

struct Range {
  float low = 0, high = 0;  // low <= 0 <= high
};

// Counts values in equal bins of a range that doubles, merging neighbouring bins, when a larger one
// comes: one pass, any scale.
class Histogram {
 public:
  void add(std::span<const float> values);
  uint64_t count() const { return count_; }
  Range min_max() const { return {low_, high_}; }  // of all values and zero
  Range percentile(double percent)
      const;  // above 50, below 100: of the values below the upper end, and above the lower one
  Range smallest_error() const;
  // Mean squared error of int8 with this range.
  double squared_error(const Range& range) const;

 private:
  static constexpr size_t kBins = 8192;  // over [-limit, limit): 16 for a step of 255 over one half
  void widen(float magnitude);
  double centre(size_t bin) const;

  std::vector<uint64_t> bins_;
  float limit_ = 0, low_ = 0, high_ = 0;
  uint64_t count_ = 0;
};

// Steps of (high - low) / 255, with zero on a step: what a ReLU leaves gets zero point -128 and
// scale high / 255. An empty range (a dead layer) gets a scale as good as any.
Quantisation quantisation_of(const Range& range);

// The scale with the smallest squared error, at most max_abs_scale
// (figurine/detail/fixed_point_weights.h). 0 if all weights are zero.
float smallest_error_scale(std::span<const float> weights);

}  // namespace figurine::quantize
