// Between Eigen's rows in double and LibTorch's in float, and noise that is a function of its
// place.
#pragma once

#include <cstdint>

#include "toolchain/measure/weight_space.h"
#include "toolchain/tensor.h"

namespace figurine::generate {

torch::Tensor to_tensor(const measure::RowMatrix& rows);  // [M,D], rounded to float
measure::RowMatrix to_rows(const torch::Tensor& values);  // [M,D] float
// [size] standard normal values of one draw; streams are told apart by their number.
torch::Tensor draw_noise(uint64_t seed, uint64_t stream, uint64_t counter, int64_t size);

}  // namespace figurine::generate
