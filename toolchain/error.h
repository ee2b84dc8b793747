// Bad input to the toolchain, as an exception: one line naming file, field and reason.
// toolchain/cli turns it into exit code 1.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "figurine/status.h"

namespace figurine {

class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The value, or an InputError with the status's message behind "where: ".
template <class T>
T value_or_throw(Result<T> result, const std::string& where) {
  if (!result.ok()) throw InputError(where + ": " + result.status().message());
  return std::move(result).value();
}

// The same of an error that names the place itself.
template <class T>
T value_or_throw(Result<T> result) {
  if (!result.ok()) throw InputError(result.status().message());
  return std::move(result).value();
}

inline void throw_if_error(const Status& status, const std::string& where) {
  if (!status.ok()) throw InputError(where + ": " + status.message());
}

}  // namespace figurine
