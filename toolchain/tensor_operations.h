// LibTorch's operations on tensors, with and without gradients: what <torch/torch.h> has without
// its modules, data sets, optimisers and serialisation. The precompiled header of the toolchain.
#pragma once

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include "toolchain/tensor.h"
