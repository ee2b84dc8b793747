// Errors as values, for everything that comes from outside: packages, data sets, motions, command
// lines, the machine itself.
//
// A Status says what went wrong (code), and in one line which file or field and why (message).
// Result<T> is a value or a Status. Nothing here throws; the runtime is built without exceptions.
// Broken contracts of callers are FIG_CHECK's (check.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "figurine/check.h"

namespace figurine {

enum class StatusCode : uint8_t {
  kOk,
  kInvalidArgument,  // a value that no input may have: NaN pose, empty image, unknown option
  kNotFound,         // a file, body or member that does not exist
  kCorrupt,          // bytes that contradict themselves: checksum, range, size, shape
  kUnsupported,      // sound, but not for this build or version
  kMismatch,         // two sound things that do not belong together: avatar and body
  kLimitExceeded,    // larger than the declared or allowed budget
  kIo,               // the operating system said no
  kOutOfMemory,
  kInterrupted,  // stopped by the user; state was saved
};

const char* to_string(StatusCode code);

class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(StatusCode code, std::string message);
  // All out of line: a status is handed on everywhere, and inline its text would make the device's
  // library 3 % larger.
  Status(const Status& other);
  Status(Status&& other) noexcept;
  Status& operator=(const Status& other);
  Status& operator=(Status&& other) noexcept;
  ~Status();

  bool ok() const { return code_ == StatusCode::kOk; }
  explicit operator bool() const { return ok(); }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }

  // The same error seen from further out: "where: message".
  Status within(const std::string& where) const {
    return ok() ? *this : Status(code_, where + ": " + message_);
  }

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

namespace detail {
// Ends as a FIG_CHECK does: a Result's error was not looked at. Out of line, because Results are
// looked into everywhere.
[[noreturn, gnu::cold]] void no_value(const Status& status);
}  // namespace detail

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)) {}
  Result(Status status) : status_(std::move(status)) {
    FIG_CHECK(!status_.ok(), "a Result without value needs an error");
  }

  bool ok() const { return value_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Status& status() const { return status_; }
  T& value() & {
    if (!ok()) detail::no_value(status_);
    return *value_;
  }
  const T& value() const& {
    if (!ok()) detail::no_value(status_);
    return *value_;
  }
  T&& value() && {
    if (!ok()) detail::no_value(status_);
    return std::move(*value_);
  }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::optional<T> value_;
  Status status_;
};

}  // namespace figurine

// Returns the error of EXPRESSION (a Status) from the enclosing function.
#define FIG_RETURN_IF_ERROR(expression)                                                       \
  do {                                                                                        \
    if (::figurine::Status fig_status_ = (expression); !fig_status_.ok()) return fig_status_; \
  } while (false)
