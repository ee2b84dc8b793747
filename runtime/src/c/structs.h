// Structs of figurine.h that grow from version to version: read from a caller who may know an
// earlier, shorter one, and filled no further than the caller's reach.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

#include "runtime/src/c/report.h"

namespace figurine::c {

// Bytes of the first version of a struct. All are of 0.2.0; one that grows says here what it was.
template <class T>
inline constexpr size_t kFirstBytes = sizeof(T);

template <class T>
Status check_struct(const T* given, const char* what) {
  static_assert(std::is_trivially_copyable_v<T> && offsetof(T, struct_bytes) == 0);
  if (given == nullptr) return invalid(std::string(what) + ": is NULL");
  if (given->struct_bytes < kFirstBytes<T>) {
    return invalid(std::string(what) + ": struct_bytes of " + std::to_string(given->struct_bytes) +
                   ", not what fig_default_...() made it");
  }
  if (given->struct_bytes > sizeof(T)) {
    return Status(StatusCode::kUnsupported,
                  std::string(what) + ": struct_bytes of " + std::to_string(given->struct_bytes) +
                      ": of a later version than this library's, or not from fig_default_...()");
  }
  return {};
}

// What the caller gave, the rest as in defaults.
template <class T>
Result<T> read_struct(const T* given, const T& defaults, const char* what) {
  if (Status sound = check_struct(given, what); !sound.ok()) return sound;
  T whole = defaults;
  std::memcpy(&whole, given, given->struct_bytes);
  return whole;
}

// The same where NULL stands for the defaults.
template <class T>
Result<T> read_options(const T* given, const T& defaults, const char* what) {
  if (given == nullptr) return defaults;
  return read_struct(given, defaults, what);
}

// Fills what the caller has room for; the struct was checked.
template <class T>
void fill_struct(T whole, T* out) {
  whole.struct_bytes = out->struct_bytes;
  std::memcpy(static_cast<void*>(out), &whole, out->struct_bytes);
}

inline Status check_out(const void* out, const char* what) {
  return out == nullptr ? invalid(std::string(what) + ": is NULL") : Status();
}

// An element of an array whose elements have the first's size.
template <class T>
const T* element(const T* first, size_t index) {
  return reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(first) +
                                    index * first->struct_bytes);
}

}  // namespace figurine::c
