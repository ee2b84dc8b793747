// malloc and its kin replaced in a test's program by ones over glibc's own that count, and that can
// say no. Under a sanitizer, which does the same, there is nothing of it.
#pragma once

#include <atomic>
#include <cstdint>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define FIG_COUNTS_ALLOCATIONS 0
#else
#define FIG_COUNTS_ALLOCATIONS 1
#endif

namespace figurine::tests {

inline std::atomic<uint64_t> g_allocations{0};
inline std::atomic<int64_t> g_held_bytes{0}, g_most_held_bytes{0};

// The n-th allocation from now on, from 1, fails, and only that one. 0: none.
void fail_allocation(uint64_t n);
// From now on every allocation fails with which more than so many bytes would be held. INT64_MAX:
// none.
void limit_held_bytes(int64_t limit);
// Ends both. How many allocations have failed since.
uint64_t stop_failing();

}  // namespace figurine::tests
