// Every error names the path and the system's reason.
#include "ports/host/files.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "ports/host/atomic_file.h"
#include "ports/host/system_error.h"

namespace figurine::ports {
namespace {

// Closes on every way out.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

Status check_regular(const std::string& path, const struct stat& info) {
  if (S_ISDIR(info.st_mode)) return system_error(path, "cannot read", EISDIR);
  if (!S_ISREG(info.st_mode))
    return Status(StatusCode::kIo, path + ": cannot read: not a regular file");
  return {};
}

}  // namespace

Result<MappedFile> MappedFile::open(const std::string& path) {
  // Without O_NONBLOCK the opening of a pipe waits for somebody who writes.
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) return system_error(path, "cannot open", errno);
  struct stat info;
  if (::fstat(file.get(), &info) != 0) return system_error(path, "cannot open", errno);
  FIG_RETURN_IF_ERROR(check_regular(path, info));

  MappedFile mapped;
  if (info.st_size > 0) {
    const size_t size = static_cast<size_t>(info.st_size);
    void* address = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
    if (address == MAP_FAILED) return system_error(path, "cannot map", errno);
    mapped.bytes_ = {static_cast<const std::byte*>(address), size};
  }
  return mapped;
}

MappedFile::MappedFile(MappedFile&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

Status check_regular_file(const std::string& path) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0) return system_error(path, "cannot open", errno);
  return check_regular(path, info);
}

Status write_file_atomically(const std::string& path, std::span<const std::byte> bytes) {
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file.ok()) return file.status();
  FIG_RETURN_IF_ERROR(file->write(bytes));
  return file->commit();
}

}  // namespace figurine::ports
