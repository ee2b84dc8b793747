// LibTorch's tensor as a type, without the operations: all that a header needs, and a file that
// passes tensors on. An eighth of the compile time of <torch/torch.h>, which no file includes: what
// computes includes toolchain/tensor_operations.h, or the one header of LibTorch that it needs.
#pragma once

#include <ATen/core/Tensor.h>

namespace torch {
using namespace at;  // as <torch/types.h> has it
}
