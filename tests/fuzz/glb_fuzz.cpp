// Any bytes as glTF, binary or JSON, read and moved onto a body. Seeds: tests/fuzz/seeds/glb.
#include <cstdint>

#include "motion_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  tests::read_and_use(bytes, ClipKind::kGltf);
  tests::read_and_use(bytes, ClipKind::kGltf, {.neutral = Neutral::kZeroPose, .checked = false});
  return 0;
}
