#include "toolchain/train/flat_tensor.h"

#include <charconv>
#include <cstring>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::train {

NamedTensor flat_tensor(const torch::Tensor& tensor) {
  const float* data = tensor.data_ptr<float>();
  return {{tensor.numel()}, {data, data + tensor.numel()}};
}

void take_flat_tensor(const TensorFile& file, const std::string& path, const std::string& name,
                      torch::Tensor& tensor) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw InputError(path + ": " + name + ": missing");
  if (found->second.values.size() != static_cast<size_t>(tensor.numel()))
    throw InputError(path + ": " + name + ": is of another size");
  std::memcpy(tensor.data_ptr<float>(), found->second.values.data(),
              found->second.values.size() * sizeof(float));
}

std::string exact_number(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof(text), value);
  return {text, end.ptr};
}

double take_number(const TensorFile& file, const std::string& path, const std::string& key) {
  const auto found = file.metadata.find(key);
  double value = 0;
  if (found == file.metadata.end() ||
      std::from_chars(found->second.data(), found->second.data() + found->second.size(), value)
              .ec != std::errc{} ||
      !(value >= 0)) {
    throw InputError(path + ": " + key + ": missing or no number");
  }
  return value;
}

}  // namespace figurine::train
