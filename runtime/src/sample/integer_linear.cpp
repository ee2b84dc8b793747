#include "runtime/src/sample/integer_linear.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/fixed_point.h"

namespace figurine {

namespace {

size_t round_up(size_t count, size_t multiple) {
  return (count + multiple - 1) / multiple * multiple;
}

}  // namespace

int32_t largest_step(size_t columns) {
  const int64_t most = std::numeric_limits<int32_t>::max() /
                       (int64_t{kWeightMax} * static_cast<int64_t>(std::max<size_t>(columns, 1)));
  return static_cast<int32_t>(std::clamp<int64_t>(most, 1, std::numeric_limits<int16_t>::max()));
}

bool RoundedRows::ensure(size_t rows, size_t columns) {
  return values_.ensure(round_up(rows, kernels::kDotsAtOnce) *
                        round_up(columns, kernels::kDotMultiple)) &&
         scale_.ensure(rows);
}

void RoundedRows::round(const float* x, size_t rows, size_t columns, size_t x_stride) {
  rows_ = rows, columns_ = columns, length_ = round_up(columns, kernels::kDotMultiple);
  const auto steps = static_cast<float>(largest_step(columns));
  for (size_t i = 0; i < rows; ++i) {
    const float* from = x + i * x_stride;
    int16_t* to = values_.data() + i * length_;
    float largest = 0;
    for (size_t k = 0; k < columns; ++k) largest = std::max(largest, std::abs(from[k]));
    // Below this a scale would be denormal: such a row is zero to everything that reads it.
    const bool is_zero = !(largest > 1e-30f);
    const float factor = is_zero ? 0.0f : steps / largest;
    scale_[i] = is_zero ? 0.0f : largest / steps;
    for (size_t k = 0; k < columns; ++k)
      to[k] = static_cast<int16_t>(clamp_and_round(from[k] * factor, -steps, steps));
    std::fill(to + columns, to + length_, int16_t{0});
  }
  std::fill(values_.data() + rows * length_,
            values_.data() + round_up(rows, kernels::kDotsAtOnce) * length_, int16_t{0});
}

void multiply(const KernelTable& kernels, const IntegerMatrix& matrix, const RoundedRows& x,
              std::span<int16_t> row, float* y, size_t y_stride) {
  constexpr size_t kRowsAtOnce = 32;
  static_assert(kRowsAtOnce % kernels::kDotsAtOnce == 0);
  const size_t columns = x.columns(), length = x.length();
  std::fill(row.begin() + static_cast<ptrdiff_t>(columns),
            row.begin() + static_cast<ptrdiff_t>(length), int16_t{0});
  for (size_t n = 0; n < matrix.rows(); ++n) {
    std::copy_n(matrix.values.data() + n * columns, columns, row.data());
    for (size_t m = 0; m < x.rows(); m += kRowsAtOnce) {
      const size_t rows = std::min(kRowsAtOnce, x.rows() - m);
      int32_t sums[kRowsAtOnce] = {};
      kernels.add_dots({.shared = row.data(),
                        .rows = x.row(m),
                        .length = length,
                        .count = round_up(rows, kernels::kDotsAtOnce),
                        .sums = sums});
      for (size_t i = 0; i < rows; ++i) {
        y[(m + i) * y_stride + n] =
            static_cast<float>(sums[i]) * (matrix.row_scale[n] * x.scale(m + i)) + matrix.bias[n];
      }
    }
  }
}

}  // namespace figurine
