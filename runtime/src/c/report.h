// How a Status leaves through C: its code as the return value, its message kept for the thread.
#pragma once

#include <string>

#include "figurine.h"
#include "figurine/status.h"

namespace figurine::c {

// Keeps the message of an error for fig_last_message(). Allocates nothing.
fig_status report(const Status& status);

Status invalid(const std::string& what);  // kInvalidArgument

}  // namespace figurine::c

// Leaves the enclosing C function with the error of EXPRESSION, a Status.
#define FIG_REPORT_IF_ERROR(expression)                                         \
  do {                                                                          \
    if (const ::figurine::Status fig_status_ = (expression); !fig_status_.ok()) \
      return ::figurine::c::report(fig_status_);                                \
  } while (false)
