// Any text as a BVH, read and moved onto a body. Seeds: tests/data/cases/bvh-* and
// tests/fuzz/seeds/bvh.
#include <cstdint>

#include "motion_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  tests::read_and_use(bytes, ClipKind::kBvh);
  tests::read_and_use(bytes, ClipKind::kBvh,
                      {.source_fps = 30, .neutral = Neutral::kZeroPose, .checked = false});
  return 0;
}
