// A file that is written piece by piece and appears whole or not at all: a temporary beside its
// place, renamed by commit(), removed by the destructor. For content that comes as a stream (video)
// or must appear together with other files (image sequences); one buffer of bytes:
// write_file_atomically.
#pragma once

#include <cstddef>
#include <cstdio>
#include <span>
#include <string>

#include "figurine/status.h"

namespace figurine::ports {

class AtomicFile {
 public:
  // Creates the temporary, in the folder of path. kIo names path and the system's reason.
  // kUnsupported if path is there and no regular file.
  static Result<AtomicFile> create(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  Status write(std::span<const std::byte> bytes);
  // Of the temporary, for a writer that needs one, in place of write(); this object's to close.
  int descriptor() const;
  // Flushes, syncs and closes: after this only the name is temporary. Optional; commit() does it
  // first.
  Status finish();
  // Gives the file its name. Call once.
  Status commit();

  const std::string& path() const { return path_; }
  const std::string& temporary_path() const { return temporary_path_; }

 private:
  AtomicFile() = default;
  Status error(const char* what, int code) const;

  std::string path_;
  std::string temporary_path_;  // empty once committed
  std::FILE* file_ = nullptr;
};

}  // namespace figurine::ports
