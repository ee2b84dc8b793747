// Any bytes into the package reader: it refuses them or keeps its promises. Each input is opened as
// it is and again behind renewed checksums, or the fuzzer would only ever see checksums fail.
// tests/golden/packages is the seed corpus.
#include <cstdint>
#include <cstdlib>

#include "figurine/package.h"
#include "formats/package_bytes.h"

namespace {

void open_and_use(std::span<const std::byte> bytes) {
  const figurine::Result<figurine::Package> package = figurine::Package::open(bytes, "fuzz");
  std::string reason;
  if (package.ok() && !figurine::samples::exercise(*package, reason)) std::abort();
  if (!package.ok() && package.status().message().find('\n') != std::string::npos) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const figurine::samples::ExactBytes bytes({reinterpret_cast<const std::byte*>(data), size});
  open_and_use(bytes.bytes());
  figurine::samples::renew_what_looks_like_a_package(bytes.bytes());
  open_and_use(bytes.bytes());
  return 0;
}
