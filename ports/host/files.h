// Files on Linux: memory maps for reading, write-to-temporary + fsync + rename for writing.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"

namespace figurine::ports {

// A read-only memory map of a whole file. Page-aligned. Empty files map to an empty span.
class MappedFile {
 public:
  // Regular files alone: a pipe is refused, not waited for.
  static Result<MappedFile> open(const std::string& path);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  ~MappedFile();
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  MappedFile() = default;
  std::span<const std::byte> bytes_;
};

// For readers that open a file by its name themselves: kNotFound, or kIo where it is a folder, a
// pipe (which would be waited for) or a device.
Status check_regular_file(const std::string& path);

// The file appears whole or not at all: written beside its place, synced, renamed (AtomicFile).
// Errors name path and the system's reason; the temporary is removed.
Status write_file_atomically(const std::string& path, std::span<const std::byte> bytes);

}  // namespace figurine::ports
