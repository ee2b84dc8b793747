#include "runtime/src/base/memory.h"

#include <cstring>
#include <string>

namespace figurine {

void* renew_buffer(void* old, size_t size_bytes) {
  void* const fresh = try_allocate(size_bytes, kBufferAlignment);
  if (fresh == nullptr) return nullptr;
  std::memset(fresh, 0, size_bytes);
  ::operator delete(old, std::align_val_t(kBufferAlignment));
  return fresh;
}

Status out_of_memory(const char* what) {
  return Status(StatusCode::kOutOfMemory, std::string("no memory for ") + what);
}

}  // namespace figurine
