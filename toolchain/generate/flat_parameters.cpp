#include "toolchain/generate/flat_parameters.h"

#include <cstring>
#include <functional>
#include <numeric>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::generate {

int64_t FlatParameter::count() const {
  return std::accumulate(shape.begin(), shape.end(), int64_t{1}, std::multiplies<>());
}

void FlatLayout::add(const std::string& name, std::vector<int64_t> shape) {
  list_.push_back({name, std::move(shape), count_});
  count_ += list_.back().count();
}

FlatParameters::FlatParameters(FlatLayout layout)
    : layout_(std::move(layout)),
      weights_(torch::zeros({layout_.count()})),
      gradients_(torch::zeros({layout_.count()})) {
  for (const FlatParameter& parameter : layout_.list()) {
    const auto view = [&](const torch::Tensor& flat) {
      return flat.narrow(0, parameter.begin, parameter.count()).view(parameter.shape);
    };
    torch::Tensor leaf = view(weights_).detach().requires_grad_();
    leaf.mutable_grad() = view(gradients_);
    leaves_.push_back(leaf);
  }
}

void save_parameters(const std::string& path, const FlatLayout& layout,
                     const torch::Tensor& values) {
  train::TensorFile file;
  const float* data = values.data_ptr<float>();
  for (const FlatParameter& parameter : layout.list()) {
    const float* begin = data + parameter.begin;
    file.tensors[parameter.name] = {parameter.shape, {begin, begin + parameter.count()}};
  }
  train::write_tensor_file(path, file);
}

void load_parameters(const std::string& path, const FlatLayout& layout, torch::Tensor& values) {
  const train::TensorFile file = train::read_tensor_file(path);
  float* data = values.data_ptr<float>();
  for (const FlatParameter& parameter : layout.list()) {
    const auto found = file.tensors.find(parameter.name);
    if (found == file.tensors.end()) throw InputError(path + ": " + parameter.name + ": missing");
    if (found->second.shape != parameter.shape)
      throw InputError(path + ": " + parameter.name + ": is of another shape");
    std::memcpy(data + parameter.begin, found->second.values.data(),
                found->second.values.size() * sizeof(float));
  }
}

}  // namespace figurine::generate
