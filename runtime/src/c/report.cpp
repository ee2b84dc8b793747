#include "runtime/src/c/report.h"

#include <algorithm>
#include <cstring>

namespace figurine::c {
namespace {

thread_local char last_message[1024] = "";

// The codes are the project's own, number for number.
static_assert(FIG_OK == static_cast<int>(StatusCode::kOk));
static_assert(FIG_INVALID_ARGUMENT == static_cast<int>(StatusCode::kInvalidArgument));
static_assert(FIG_NOT_FOUND == static_cast<int>(StatusCode::kNotFound));
static_assert(FIG_CORRUPT == static_cast<int>(StatusCode::kCorrupt));
static_assert(FIG_UNSUPPORTED == static_cast<int>(StatusCode::kUnsupported));
static_assert(FIG_MISMATCH == static_cast<int>(StatusCode::kMismatch));
static_assert(FIG_LIMIT_EXCEEDED == static_cast<int>(StatusCode::kLimitExceeded));
static_assert(FIG_IO == static_cast<int>(StatusCode::kIo));
static_assert(FIG_OUT_OF_MEMORY == static_cast<int>(StatusCode::kOutOfMemory));
static_assert(FIG_INTERRUPTED == static_cast<int>(StatusCode::kInterrupted));

}  // namespace

Status invalid(const std::string& what) { return Status(StatusCode::kInvalidArgument, what); }

fig_status report(const Status& status) {
  if (status.ok()) return FIG_OK;
  const std::string& message = status.message();
  const size_t size = std::min(message.size(), sizeof last_message - 1);
  std::memcpy(last_message, message.data(), size);
  last_message[size] = '\0';
  std::replace(last_message, last_message + size, '\n', ' ');  // of a name that the caller gave
  return static_cast<fig_status>(status.code());
}

fig_status report_no_memory() { return report(no_memory()); }

}  // namespace figurine::c

const char* fig_last_message(void) { return figurine::c::last_message; }
