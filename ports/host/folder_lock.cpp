#include "ports/host/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "ports/host/clock.h"

namespace figurine::ports {

namespace {
constexpr uint64_t kPoll_ns = 50'000'000;
}  // namespace

Result<FolderLock> FolderLock::acquire(const std::string& folder, double patience_s) {
  return lock(folder, LOCK_EX, patience_s);
}

Result<FolderLock> FolderLock::share(const std::string& folder, double patience_s) {
  return lock(folder, LOCK_SH, patience_s);
}

Result<FolderLock> FolderLock::lock(const std::string& folder, int how, double patience_s) {
  // Not inherited by programs that are started: the lock would outlive its process in them.
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0)
    return Status(StatusCode::kIo,
                  folder + ": cannot be opened: " + std::generic_category().message(errno));
  FolderLock lock(fd);
  const uint64_t start = now_ns(), patience_ns = static_cast<uint64_t>(1e9 * patience_s);
  while (::flock(fd, how | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    if (now_ns() - start < patience_ns) {
      sleep_until(now_ns() + kPoll_ns);
      continue;
    }
    return Status(StatusCode::kIo, folder + ": another process is at work in it");
  }
  return lock;
}

FolderLock::FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

FolderLock& FolderLock::operator=(FolderLock&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

}  // namespace figurine::ports
