// What the system says when a file cannot be had, as a Status that names the file.
#pragma once

#include <cerrno>
#include <string>
#include <system_error>

#include "figurine/status.h"

namespace figurine::ports {

// "path: what: reason". kNotFound and kOutOfMemory where the error says so, otherwise kIo.
inline Status system_error(const std::string& path, const char* what, int error) {
  const StatusCode code = error == ENOENT || error == ENOTDIR ? StatusCode::kNotFound
                          : error == ENOMEM                   ? StatusCode::kOutOfMemory
                                                              : StatusCode::kIo;
  return Status(code, path + ": " + what + ": " + std::generic_category().message(error));
}

}  // namespace figurine::ports
