#include "figurine/status.h"

namespace figurine {

const char* to_string(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return "ok";
    case StatusCode::kInvalidArgument:
      return "invalid argument";
    case StatusCode::kNotFound:
      return "not found";
    case StatusCode::kCorrupt:
      return "corrupt";
    case StatusCode::kUnsupported:
      return "unsupported";
    case StatusCode::kMismatch:
      return "mismatch";
    case StatusCode::kLimitExceeded:
      return "limit exceeded";
    case StatusCode::kIo:
      return "input/output error";
    case StatusCode::kOutOfMemory:
      return "out of memory";
    case StatusCode::kInterrupted:
      return "interrupted";
  }
  return "unknown status";
}

Status::Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}
Status::Status(const Status& other) = default;
Status::Status(Status&& other) noexcept = default;
Status& Status::operator=(const Status& other) = default;
Status& Status::operator=(Status&& other) noexcept = default;
Status::~Status() = default;

void detail::no_value(const Status& status) {
  check_failed(__FILE__, __LINE__, status.message().c_str(), "the Result has a value");
}

}  // namespace figurine
