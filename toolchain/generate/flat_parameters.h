// The parameters of a network as one flat tensor, so that the optimiser, the moving average,
// checkpoints and an all-reduce are each one operation; beside it the gradients, and a leaf of each
// parameter's shape that is a view of both.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "toolchain/tensor.h"

namespace figurine::generate {

// Where a named parameter lies in the flat tensor.
struct FlatParameter {
  std::string name;
  std::vector<int64_t> shape;
  int64_t begin = 0;

  int64_t count() const;  // of its values
};

// Names and shapes in the order of the flat tensor, without the tensor itself.
class FlatLayout {
 public:
  void add(const std::string& name, std::vector<int64_t> shape);
  const std::vector<FlatParameter>& list() const { return list_; }
  int64_t count() const { return count_; }  // P

 private:
  std::vector<FlatParameter> list_;
  int64_t count_ = 0;
};

class FlatParameters {
 public:
  explicit FlatParameters(FlatLayout layout);  // all zero

  const FlatLayout& layout() const { return layout_; }
  torch::Tensor& weights() { return weights_; }      // [P]; assign into it in place only
  torch::Tensor& gradients() { return gradients_; }  // [P]; backward passes add to it
  // The layout's i-th parameter, differentiable: its gradient lies in gradients().
  const torch::Tensor& leaf(size_t i) const { return leaves_[i]; }

 private:
  FlatLayout layout_;
  torch::Tensor weights_, gradients_;
  std::vector<torch::Tensor> leaves_;
};

// A safetensors file with one tensor a parameter. values: [P]. Throws InputError, for reading
// naming the parameter that does not fit.
void save_parameters(const std::string& path, const FlatLayout& layout,
                     const torch::Tensor& values);
void load_parameters(const std::string& path, const FlatLayout& layout, torch::Tensor& values);

}  // namespace figurine::generate
