// One process at a time works in a folder, or several that know how to work beside each other. The
// lock is on the folder itself and leaves nothing
// behind: the system takes it back when the process ends, however it ends.
#pragma once

#include <string>

#include "figurine/status.h"

namespace figurine::ports {

class FolderLock {
 public:
  // The folder must exist. kIo, naming it, if another lock holds it, in this process or in another
  // one, for all of patience_s. File systems without locks (some network ones) give one that holds
  // nobody off. A process that is forked holds it, too, until it ends.
  static Result<FolderLock> acquire(const std::string& folder, double patience_s = 0);
  // The same among those that share it: an error only while somebody has the folder for himself,
  // who gets it only when all that share it have left.
  static Result<FolderLock> share(const std::string& folder, double patience_s = 0);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&& other) noexcept;
  ~FolderLock();

 private:
  static Result<FolderLock> lock(const std::string& folder, int how, double patience_s);
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

}  // namespace figurine::ports
