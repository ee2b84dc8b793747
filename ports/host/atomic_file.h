// A file that is written piece by piece and appears whole or not at all: a temporary beside its
// place, renamed by commit(), removed by the destructor. For content that comes as a stream (video)
// or must appear together with other files (image sequences); one buffer of bytes:
// write_file_atomically (files.h).
//
// A process that is killed leaves its temporaries. The next one that writes into the same folder
// removes those whose process is gone, once; a symbolic link is followed, so that what it points to
// is replaced and the link stays.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/status.h"

namespace figurine::ports {

class AtomicFile {
 public:
  // Creates the temporary, in the folder of path. kIo (kNotFound, kOutOfMemory) names path and the
  // system's reason; kIo too if path is there and no regular file.
  static Result<AtomicFile> create(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  // All of bytes, through interruptions and short writes.
  Status write(std::span<const std::byte> bytes);
  // Of the temporary, for a writer that needs one, in place of write(); this object's to close.
  int descriptor() const;
  // Syncs and closes: after this only the name is temporary. Optional; commit() does it first.
  Status finish();
  // Gives the file its name, on disk when it returns. Call once.
  Status commit();
  // As commit(), but the disk may not have it yet: for thousands of files that are synced together.
  // After a loss of power such a file can be empty.
  Status commit_unsynced();

  const std::string& path() const { return path_; }
  const std::string& temporary_path() const { return temporary_path_; }

 private:
  AtomicFile() = default;
  Status close(bool sync);
  Status rename();

  std::string path_;            // as given
  std::string target_;          // behind symbolic links
  std::string temporary_path_;  // empty once committed
  int file_ = -1;
};

// Removes what killed processes left in a folder: temporaries of AtomicFile whose process, of this
// machine since it was started, is gone; those of another machine (or another start, or another
// space of process numbers) once they are a day old. Says nothing if it cannot.
void sweep_temporaries(const std::string& folder);

}  // namespace figurine::ports
