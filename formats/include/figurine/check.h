// Contract checks. A failed check is the caller's bug, never a reaction to data: bytes from outside
// get a Status (status.h).
#pragma once

#include <cstdio>
#include <cstdlib>

// On in every build: prints the broken contract and aborts.
#define FIG_CHECK(condition, message)                                                        \
  do {                                                                                       \
    if (!(condition)) {                                                                      \
      std::fprintf(stderr, "%s:%d: contract broken: %s (%s)\n", __FILE__, __LINE__, message, \
                   #condition);                                                              \
      std::abort();                                                                          \
    }                                                                                        \
  } while (false)

// For invariants of hot paths: on in debug and RelWithDebInfo builds.
#if defined(FIGURINE_DCHECKS) || !defined(NDEBUG)
#define FIG_DCHECK(condition, message) FIG_CHECK(condition, message)
#else
#define FIG_DCHECK(condition, message) ((void)0)
#endif
