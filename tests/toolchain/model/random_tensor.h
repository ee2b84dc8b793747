// Tensors for tests: normal numbers of a seed, and a tensor's floats as doubles.
#pragma once

#include <random>
#include <vector>

#include "toolchain/tensor_operations.h"

namespace figurine::testing_tools {

inline torch::Tensor random_tensor(std::vector<int64_t> sizes, uint32_t seed) {
  torch::Tensor tensor = torch::empty(sizes);
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (int64_t i = 0; i < tensor.numel(); ++i) tensor.data_ptr<float>()[i] = normal(random);
  return tensor;
}

inline std::vector<double> to_double(const torch::Tensor& tensor) {
  const float* data = tensor.const_data_ptr<float>();
  return {data, data + tensor.numel()};
}

}  // namespace figurine::testing_tools
