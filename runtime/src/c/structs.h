// Structs of figurine.h that grow from version to version: read from a caller who may know an
// earlier, shorter one, and filled no further than the caller's reach.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "runtime/src/c/report.h"

namespace figurine::c {

// Bytes of the first version of a struct. All are of 0.2.0; one that grows says here what it was.
template <class T>
inline constexpr size_t kFirstBytes = sizeof(T);

// kInvalidArgument where the struct is NULL or too small for any version, kUnsupported where it is
// larger than this one's.
Status check_size(const size_t* struct_bytes, size_t first_bytes, size_t known_bytes,
                  const char* what);
void set_default_bytes(const void* whole, size_t whole_bytes, void* out, size_t struct_bytes);

template <class T>
const size_t* size_of(const T* given) {
  static_assert(std::is_trivially_copyable_v<T> && offsetof(T, struct_bytes) == 0);
  return reinterpret_cast<const size_t*>(given);
}

template <class T>
Status check_struct(const T* given, const char* what) {
  return check_size(size_of(given), kFirstBytes<T>, sizeof(T), what);
}

// The defaults as far as the caller's struct reaches; what a later version added to it is zero, and
// its size remains for check_struct to refuse.
template <class T>
void set_default(const T& whole, T* out, size_t struct_bytes) {
  set_default_bytes(&whole, sizeof whole, out, struct_bytes);
}

// Over the defaults in out, what the caller gave.
template <class T>
Status read_struct(const T* given, const char* what, T& out) {
  Status sound = check_struct(given, what);
  if (sound.ok()) std::memcpy(static_cast<void*>(&out), given, given->struct_bytes);
  return sound;
}

// The same where NULL stands for the defaults.
template <class T>
Status read_options(const T* given, const char* what, T& out) {
  return given == nullptr ? Status() : read_struct(given, what, out);
}

// Fills what the caller has room for; the struct was checked.
template <class T>
void fill_struct(T whole, T* out) {
  whole.struct_bytes = out->struct_bytes;
  std::memcpy(static_cast<void*>(out), &whole, out->struct_bytes);
}

Status check_out(const void* out, const char* what);  // kInvalidArgument "WHAT: is NULL"

// An element of an array whose elements have the first's size.
template <class T>
const T* element(const T* first, size_t index) {
  return reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(first) +
                                    index * first->struct_bytes);
}

}  // namespace figurine::c
