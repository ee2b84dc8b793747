// Any bytes as a pickled number (MVHumanNet's camera_scale.pkl): refused in one line that begins
// with the file, or a finite number. Seeds: tests/fuzz/seeds/camera_scale.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "toolchain/dataset/pickle.h"
#include "toolchain/error.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const double number = figurine::dataset::read_pickled_number(
        {reinterpret_cast<const std::byte*>(data), size}, "fuzz.pkl");
    if (!std::isfinite(number)) std::abort();
  } catch (const figurine::InputError& error) {
    const std::string_view message = error.what();
    if (!message.starts_with("fuzz.pkl") || message.find('\n') != std::string_view::npos)
      std::abort();
  }
  return 0;
}
