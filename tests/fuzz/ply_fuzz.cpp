// Any bytes as a .ply, plain or compressed. Seeds: tests/fuzz/seeds/ply.
#include "gaussians_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  tests::read_and_use(tests::bytes_of(data, size), "fuzz.ply");
  return 0;
}
