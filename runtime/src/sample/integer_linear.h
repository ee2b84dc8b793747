// y = W x + b with an int8 matrix and x rounded to int16 where it is used: what a sampler's
// transformer is made of.
//
//   x_q = round(x / s), s = max |x| / A of every row of x, A = min(32767, (2^31 - 1) / (127
//       columns)), rounded down
//   y_n = float(sum over k of W_nk x_qk) * (row_scale_n * s) + b_n
//
// With this A no int32 sum can overflow, so sums are exact and every CPU has the same bits; int16
// keeps the rounding of x (14 bits and more) far below that of W.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/table.h"

namespace figurine {

// Largest magnitude of a rounded x for so many columns, at least 1.
int32_t largest_step(size_t columns);

// Rows of x, rounded. Reused from product to product.
class RoundedRows {
 public:
  // Room for the largest product. False without memory.
  bool ensure(size_t rows, size_t columns);

  // x: [rows,columns], rows x_stride apart. A row that is zero throughout stays so; values that are
  // not finite give some integers.
  void round(const float* x, size_t rows, size_t columns, size_t x_stride);

  size_t rows() const { return rows_; }
  size_t columns() const { return columns_; }
  size_t length() const {
    return length_;
  }  // between rows; a multiple of kernels::kDotMultiple, zero behind the columns
  const int16_t* row(size_t i) const { return values_.data() + i * length_; }
  float scale(size_t i) const { return scale_[i]; }
  uint64_t memory_bytes() const { return values_.memory_bytes() + scale_.memory_bytes(); }

 private:
  size_t rows_ = 0, columns_ = 0, length_ = 0;
  Buffer<int16_t> values_;  // rows rounded up to a multiple of kernels::kDotsAtOnce
  Buffer<float> scale_;
};

struct IntegerMatrix {
  std::span<const int8_t> values;    // [rows,columns], -127 to 127
  std::span<const float> row_scale;  // [rows]
  std::span<const float> bias;       // [rows]

  size_t rows() const { return row_scale.size(); }
  size_t columns() const { return values.size() / rows(); }
};

// y: [x.rows(),matrix.rows()], rows y_stride apart. x.columns() must be matrix.columns(). row: of
// x.length() values.
void multiply(const KernelTable& kernels, const IntegerMatrix& matrix, const RoundedRows& x,
              std::span<int16_t> row, float* y, size_t y_stride);

}  // namespace figurine
