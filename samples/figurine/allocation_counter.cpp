// The program's own malloc family comes before the C library's at link time; each function counts
// and passes on to glibc's internal name of the same thing. free() stays glibc's, since all memory
// is. Operator new ends in malloc, so C++ and C (XNNPACK, the thread pool) are both seen.
#include "samples/figurine/allocation_counter.h"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define FIG_WRAPS_MALLOC 0
#else
#define FIG_WRAPS_MALLOC 1
#endif

namespace {

std::atomic<bool> counting{false};
std::atomic<uint64_t> allocations{0};

[[maybe_unused]] void note() {
  if (counting.load(std::memory_order_relaxed)) allocations.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

namespace figurine::samples {

bool can_count_allocations() { return FIG_WRAPS_MALLOC != 0; }

void start_counting_allocations() {
  allocations = 0;
  counting = true;
}

uint64_t stop_counting_allocations() {
  counting = false;
  return allocations;
}

}  // namespace figurine::samples

#if FIG_WRAPS_MALLOC
#pragma GCC visibility push(default)
extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

void* malloc(size_t size) {
  note();
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  note();
  return __libc_calloc(count, size);
}
void* realloc(void* memory, size_t size) {
  note();
  return __libc_realloc(memory, size);
}
void* memalign(size_t alignment, size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, size_t alignment, size_t size) {
  if (alignment < sizeof(void*) || (alignment & (alignment - 1)) != 0) return EINVAL;
  note();
  void* result = __libc_memalign(alignment, size);
  if (result == nullptr) return ENOMEM;
  *memory = result;
  return 0;
}
}
#pragma GCC visibility pop
#endif
