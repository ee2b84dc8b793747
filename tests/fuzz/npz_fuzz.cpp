// Any bytes as an .npz of SMPL's parameters; and as its arrays (.npy, one behind the other) behind
// checksums that are right. Seeds: tests/fuzz/seeds/npz.
#include <cstdint>

#include "motion_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  tests::read_and_use({reinterpret_cast<const std::byte*>(data), size}, ClipKind::kNpz);
  // NAME '\0' and the bytes up to the next "\n\n": an array each.
  const std::string text(reinterpret_cast<const char*>(data), size);
  std::map<std::string, std::string> arrays;
  for (size_t at = 0; at < text.size() && arrays.size() < 8;) {
    const size_t name = text.find('\0', at);
    if (name == std::string::npos || name - at > 32) break;
    size_t end = text.find("\n\n\n\n", name + 1);
    if (end == std::string::npos) end = text.size();
    arrays[text.substr(at, name - at)] = text.substr(name + 1, end - name - 1);
    at = end + 4;
  }
  if (arrays.empty()) return 0;
  const std::string file = tests::stored_npz(arrays);
  tests::read_and_use(tests::bytes_of(file), ClipKind::kNpz, {.checked = false});
  return 0;
}
