// Contract checks. A failed check is the caller's bug, never a reaction to data: bytes from outside
// get a Status (status.h).
#pragma once

namespace figurine {

// Told of a broken contract in one line, on the thread that broke it, before the program aborts: to
// write it where a device keeps its log. Without one the line goes to stderr. `user` is handed on
// as it is. Set it before other threads use figurine; null takes it back.
using CheckHandler = void (*)(const char* message, void* user);
void set_check_handler(CheckHandler handler, void* user);

// What FIG_CHECK calls: tells the handler, then aborts.
[[noreturn, gnu::cold]] void check_failed(const char* file, int line, const char* message,
                                          const char* condition);

}  // namespace figurine

// On in every build: says which contract was broken and aborts.
#define FIG_CHECK(condition, message)                                    \
  do {                                                                   \
    if (!(condition)) {                                                  \
      ::figurine::check_failed(__FILE__, __LINE__, message, #condition); \
    }                                                                    \
  } while (false)

// For invariants of hot paths: on in debug and RelWithDebInfo builds.
#if defined(FIGURINE_DCHECKS) || !defined(NDEBUG)
#define FIG_DCHECK(condition, message) FIG_CHECK(condition, message)
#else
#define FIG_DCHECK(condition, message) ((void)0)
#endif
