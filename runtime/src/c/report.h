// How a Status leaves through C: its code as the return value, its message kept for the thread.
#pragma once

#include <string>

#include "figurine.h"
#include "figurine/detail/memory_reserve.h"
#include "figurine/status.h"

namespace figurine::c {

// Keeps the message of an error for fig_last_message(). Allocates nothing.
fig_status report(const Status& status);

fig_status report_no_memory();

Status invalid(const std::string& what);  // kInvalidArgument

}  // namespace figurine::c

// First in a C function that is no _destroy or _close, which take back and never refuse: room for
// its messages and little lists, or for SIZE_BYTES of them (figurine/detail/memory_reserve.h);
// leaves the function where there is none.
#define FIG_RESERVE_OR_REPORT(...)                          \
  const ::figurine::MemoryReserve fig_reserve{__VA_ARGS__}; \
  if (!fig_reserve.held()) return ::figurine::c::report_no_memory()

// Leaves the enclosing C function with the error of EXPRESSION, a Status.
#define FIG_REPORT_IF_ERROR(expression)                                         \
  do {                                                                          \
    if (const ::figurine::Status fig_status_ = (expression); !fig_status_.ok()) \
      return ::figurine::c::report(fig_status_);                                \
  } while (false)
