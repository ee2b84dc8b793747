// Counts heap allocations of the whole process, all threads and libraries, while switched on. For
// bench and its test: a frame allocates nothing.
#pragma once

#include <cstdint>

namespace figurine::samples {

// False where malloc cannot be wrapped: sanitizer builds (they bring their own) and C libraries
// other than glibc.
bool can_count_allocations();
// Switches counting on, from zero.
void start_counting_allocations();
// Switches it off. Calls of malloc, calloc, realloc and the aligned ones since the start.
uint64_t stop_counting_allocations();

}  // namespace figurine::samples
