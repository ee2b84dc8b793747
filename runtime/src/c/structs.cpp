#include "runtime/src/c/structs.h"

#include <algorithm>
#include <string>

namespace figurine::c {

Status check_out(const void* out, const char* what) {
  return out == nullptr ? invalid(std::string(what) + ": is NULL") : Status();
}

Status check_size(const size_t* struct_bytes, size_t first_bytes, size_t known_bytes,
                  const char* what) {
  FIG_RETURN_IF_ERROR(check_out(struct_bytes, what));
  if (*struct_bytes >= first_bytes && *struct_bytes <= known_bytes) return {};
  const std::string size =
      std::string(what) + ": struct_bytes of " + std::to_string(*struct_bytes) + ": ";
  if (*struct_bytes < first_bytes) return invalid(size + "not from fig_default_...()");
  return Status(StatusCode::kUnsupported,
                size + "of a later version than this library's, or not from fig_default_...()");
}

void set_default_bytes(const void* whole, size_t whole_bytes, void* out, size_t struct_bytes) {
  if (out == nullptr || struct_bytes < sizeof struct_bytes) return;
  std::memset(out, 0, struct_bytes);
  std::memcpy(out, whole, std::min(struct_bytes, whole_bytes));
  std::memcpy(out, &struct_bytes, sizeof struct_bytes);
}

}  // namespace figurine::c
