// Memory that can say no: aligned, padded buffers that only ever grow, so that a frame allocates
// nothing once its buffers have their size.
//
// std::vector would throw on failure; here ensure() returns false and the caller answers with
// kOutOfMemory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include "figurine/check.h"
#include "figurine/detail/memory_reserve.h"
#include "figurine/status.h"

namespace figurine {

inline constexpr size_t kBufferAlignment = 64;
inline constexpr size_t kBufferPadding =
    64;  // addressable bytes behind the last element: XNNPACK and vector loads read past the end

// Memory of a Buffer's, of zeros, in the place of `old`, which is freed; null, and old stays, if
// there is none. Out of line: buffers grow in a hundred places.
void* renew_buffer(void* old, size_t size_bytes);

template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~Buffer() { ::operator delete(data_, std::align_val_t(kBufferAlignment)); }

  // Room for count elements. Growing loses the contents; new memory is zero. False if there is
  // none.
  bool ensure(size_t count) {
    if (count <= capacity_) return true;
    if (count > (std::numeric_limits<size_t>::max() - kBufferPadding) / sizeof(T)) return false;
    void* const fresh = renew_buffer(data_, count * sizeof(T) + kBufferPadding);
    if (fresh == nullptr) return false;
    data_ = static_cast<T*>(fresh);
    capacity_ = count;
    return true;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  std::span<T> span(size_t count) {
    FIG_DCHECK(count <= capacity_, "span within the buffer");
    return {data_, count};
  }
  std::span<const T> span(size_t count) const {
    FIG_DCHECK(count <= capacity_, "span within the buffer");
    return {data_, count};
  }
  uint64_t memory_bytes() const {
    return data_ == nullptr ? 0 : capacity_ * sizeof(T) + kBufferPadding;
  }

 private:
  T* data_ = nullptr;
  size_t capacity_ = 0;
};

// "no memory for WHAT". Out of line: inline at each of its fifty callers it would make the device's
// library 2 % larger.
Status out_of_memory(const char* what);

}  // namespace figurine
