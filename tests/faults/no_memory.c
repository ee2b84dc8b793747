// LD_PRELOAD layer: the n-th allocation of the process fails, and only that one.
//
//   FAULT_AT=N       which allocation, from 1; 0 or nothing: none
//   FAULT_COUNT=FILE where their number is written at the end
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);

static atomic_long allocations;
static long failing = -1;

static int fails(void) {
  if (failing < 0) {
    const char* at = getenv("FAULT_AT");
    failing = at == NULL ? 0 : atol(at);
  }
  if (atomic_fetch_add(&allocations, 1) + 1 != failing) return 0;
  errno = ENOMEM;
  return 1;
}

void* malloc(size_t size) { return fails() ? NULL : __libc_malloc(size); }
void* calloc(size_t n, size_t size) { return fails() ? NULL : __libc_calloc(n, size); }
void* realloc(void* block, size_t size) { return fails() ? NULL : __libc_realloc(block, size); }
void* memalign(size_t alignment, size_t size) {
  return fails() ? NULL : __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }
int posix_memalign(void** block, size_t alignment, size_t size) {
  *block = memalign(alignment, size);
  return *block == NULL ? ENOMEM : 0;
}

__attribute__((destructor)) static void tell(void) {
  const char* file = getenv("FAULT_COUNT");
  if (file == NULL) return;
  const int fd = open(file, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (fd >= 0) dprintf(fd, "%ld\n", atomic_load(&allocations)), close(fd);
}
