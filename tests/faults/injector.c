// LD_PRELOAD layer: the n-th call that changes a file fails.
//
//   FAULT_AT=N       which call, from 1; 0 or nothing: none
//   FAULT_KIND=...   enospc, eio, eintr (write and fsync only), short (a write of one byte), kill
//                    (SIGKILL in place of the call)
//   FAULT_COUNT=FILE where the number of calls is written at the end, for a run without a fault
//
// Counted are open with O_CREAT, write (on files: not the first three descriptors), fsync, rename,
// mkdir and ftruncate. A kind that does not fit the call leaves it alone.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static atomic_long calls;

static int is_kind(const char* kind) {
  const char* wanted = getenv("FAULT_KIND");
  return wanted != NULL && strcmp(wanted, kind) == 0;
}

// Whether this call is the one.
static int is_due(void) {
  const char* at = getenv("FAULT_AT");
  const int due = atomic_fetch_add(&calls, 1) + 1 == (at == NULL ? 0 : atol(at));
  if (due && is_kind("kill")) raise(SIGKILL);
  return due;
}

static int fails(int may_be_interrupted) {
  if (!is_due()) return 0;
  if (is_kind("enospc"))
    errno = ENOSPC;
  else if (is_kind("eio"))
    errno = EIO;
  else if (is_kind("eintr") && may_be_interrupted)
    errno = EINTR;
  else
    return 0;
  return 1;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int fd, const void* bytes, size_t size) {
  struct stat info;
  if (fd > 2 && fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && is_due()) {
    if (is_kind("short") && size > 1) return NEXT(write)(fd, bytes, 1);
    if (is_kind("enospc") || is_kind("eio") || is_kind("eintr")) {
      errno = is_kind("enospc") ? ENOSPC : is_kind("eio") ? EIO : EINTR;
      return -1;
    }
  }
  return NEXT(write)(fd, bytes, size);
}

int fsync(int fd) { return fails(1) ? -1 : NEXT(fsync)(fd); }
int rename(const char* from, const char* to) { return fails(0) ? -1 : NEXT(rename)(from, to); }
int mkdir(const char* path, mode_t mode) { return fails(0) ? -1 : NEXT(mkdir)(path, mode); }
int ftruncate(int fd, off_t size) { return fails(0) ? -1 : NEXT(ftruncate)(fd, size); }

static int opened(int (*next)(const char*, int, ...), const char* path, int flags, mode_t mode) {
  if ((flags & O_CREAT) != 0 && fails(0)) return -1;
  return next(path, flags, mode);
}
int open(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  return opened(NEXT(open), path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  return opened(NEXT(open64), path, flags, mode);
}

__attribute__((destructor)) static void tell(void) {
  const char* file = getenv("FAULT_COUNT");
  if (file == NULL) return;
  FILE* out = fopen(file, "w");
  if (out == NULL) return;
  fprintf(out, "%ld\n", atomic_load(&calls));
  fclose(out);
}
