#include "runtime/counted_malloc.h"

#include <malloc.h>

#include <cerrno>
#include <cstddef>
#include <limits>

namespace figurine::tests {
namespace {

constexpr int64_t kNoLimit = std::numeric_limits<int64_t>::max();

std::atomic<uint64_t> failing{0}, failed{0};  // failing: the allocation's number, 0: none
std::atomic<int64_t> limit_bytes{kNoLimit};

}  // namespace

void fail_allocation(uint64_t n) {
  failed = 0;
  failing = n == 0 ? 0 : g_allocations + n;
}

void limit_held_bytes(int64_t limit) {
  failed = 0;
  limit_bytes = limit;
}

uint64_t stop_failing() {
  failing = 0;
  limit_bytes = kNoLimit;
  return failed;
}

#if FIG_COUNTS_ALLOCATIONS
namespace {

bool refuses(size_t size) {
  const uint64_t number = g_allocations.fetch_add(1, std::memory_order_relaxed) + 1;
  const bool is_due = number == failing.load(std::memory_order_relaxed),
             is_over =
                 static_cast<int64_t>(size) > limit_bytes.load(std::memory_order_relaxed) -
                                                  g_held_bytes.load(std::memory_order_relaxed);
  if (!is_due && !is_over) return false;
  failed.fetch_add(1, std::memory_order_relaxed);
  errno = ENOMEM;
  return true;
}

void* count(void* block) {
  if (block == nullptr) return block;
  const auto size = static_cast<int64_t>(malloc_usable_size(block));
  const int64_t held = g_held_bytes.fetch_add(size, std::memory_order_relaxed) + size;
  int64_t most = g_most_held_bytes.load(std::memory_order_relaxed);
  while (held > most && !g_most_held_bytes.compare_exchange_weak(most, held)) {
  }
  return block;
}

void uncount(void* block) {
  if (block == nullptr) return;
  g_held_bytes.fetch_sub(static_cast<int64_t>(malloc_usable_size(block)),
                         std::memory_order_relaxed);
}

}  // namespace
#endif
}  // namespace figurine::tests

#if FIG_COUNTS_ALLOCATIONS
#pragma GCC visibility push(default)  // hidden ones would not take the place of malloc in XNNPACK
extern "C" {
using namespace figurine::tests;
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);

void* malloc(size_t size) { return refuses(size) ? nullptr : count(__libc_malloc(size)); }
void* calloc(size_t n, size_t size) {
  return refuses(n * size) ? nullptr : count(__libc_calloc(n, size));
}
void* realloc(void* block, size_t size) {
  if (refuses(size)) return nullptr;
  uncount(block);
  return count(__libc_realloc(block, size));
}
void* memalign(size_t alignment, size_t size) {
  return refuses(size) ? nullptr : count(__libc_memalign(alignment, size));
}
void* aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }
int posix_memalign(void** block, size_t alignment, size_t size) {
  *block = memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  uncount(block);
  __libc_free(block);
}
}
#pragma GCC visibility pop
#endif
