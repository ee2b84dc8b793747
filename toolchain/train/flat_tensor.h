// What checkpoints of a training hold: flat tensors by name, and numbers as metadata that come back
// to the bit.
#pragma once

#include <string>

#include "toolchain/tensor.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::train {

NamedTensor flat_tensor(const torch::Tensor& tensor);  // float, contiguous
// Throws InputError naming path and tensor: missing, or of another size.
void take_flat_tensor(const TensorFile& file, const std::string& path, const std::string& name,
                      torch::Tensor& tensor);

std::string exact_number(double value);  // the shortest text that reads back as the same
// Throws InputError naming path and key: missing, no number, or a negative one.
double take_number(const TensorFile& file, const std::string& path, const std::string& key);

}  // namespace figurine::train
