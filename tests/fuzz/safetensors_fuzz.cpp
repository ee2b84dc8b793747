// Any bytes as a file of tensors: refused in one line that begins with the file, or finite values
// of the shapes that are said. Seeds: tests/fuzz/seeds/safetensors.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "toolchain/error.h"
#include "toolchain/train/tensor_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const figurine::train::TensorFile file = figurine::train::parse_tensor_file(
        {reinterpret_cast<const std::byte*>(data), size}, "fuzz.safetensors");
    for (const auto& [name, tensor] : file.tensors) {
      size_t count = 1;
      for (const int64_t side : tensor.shape) count *= static_cast<size_t>(side);
      if (count != tensor.values.size()) std::abort();
      for (const float value : tensor.values) {
        if (!std::isfinite(value)) std::abort();
      }
    }
  } catch (const figurine::InputError& error) {
    const std::string_view message = error.what();
    if (!message.starts_with("fuzz.safetensors") || message.find('\n') != std::string_view::npos)
      std::abort();
  }
  return 0;
}
