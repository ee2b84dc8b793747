// Any bytes as a .splat, as they are and cut to whole Gaussians. Seeds: tests/fuzz/seeds/splat.
#include "gaussians_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  const std::span bytes = tests::bytes_of(data, size);
  tests::read_and_use(bytes, "fuzz.splat");
  if (size % 32 != 0) tests::read_and_use(bytes.first(size - size % 32), "fuzz.splat");
  return 0;
}
