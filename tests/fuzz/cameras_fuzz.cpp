// Any text into the reader of camera files: it refuses it in one line that begins with the file, or
// returns cameras that validate_camera() takes. tests/fuzz/seeds/cameras is the seed corpus.
#include <cstdint>
#include <cstdlib>

#include "samples/common/camera_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const char* which : {"", "1", "a"}) {
    const figurine::Result<figurine::samples::FileCamera> file =
        figurine::samples::parse_camera_file(text, "fuzz.json", which);
    if (!file.ok()) {
      const std::string& message = file.status().message();
      if (!message.starts_with("fuzz.json") || message.find('\n') != std::string::npos)
        std::abort();
      continue;
    }
    const figurine::Result<figurine::Camera> camera =
        figurine::samples::fixed_camera(*file, std::nullopt, {64, 48}, {1e6, -2e6, 3});
    if (camera.ok() && !figurine::validate_camera(*camera).ok()) std::abort();
  }
  return 0;
}
