#include "ports/host/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace figurine::ports {

Status AtomicFile::error(const char* what, int code) const {
  return Status(StatusCode::kIo, path_ + ": " + what + ": " + std::strerror(code));
}

Result<AtomicFile> AtomicFile::create(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  AtomicFile result;
  result.path_ = path;
  struct stat existing{};
  if (::stat(path.c_str(), &existing) == 0 && !S_ISREG(existing.st_mode)) {
    return Status(StatusCode::kUnsupported, path + ": is not a regular file");
  }
  const std::filesystem::path place(path);
  if (!place.has_filename()) return Status(StatusCode::kInvalidArgument, path + ": names no file");
  const std::string hidden = "." + place.filename().string() + "." + std::to_string(::getpid()) +
                             "." + std::to_string(counter++) + ".tmp";
  result.temporary_path_ = (place.parent_path() / hidden).string();
  const int descriptor =
      ::open(result.temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    const Status status = result.error("cannot be written", errno);
    result.temporary_path_.clear();
    return status;
  }
  result.file_ = ::fdopen(descriptor, "wb");
  if (result.file_ == nullptr) {
    const Status status = result.error("cannot be written", errno);
    ::close(descriptor);
    return status;
  }
  return result;
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_path_(std::move(other.temporary_path_)),
      file_(other.file_) {
  other.temporary_path_.clear();
  other.file_ = nullptr;
}

AtomicFile::~AtomicFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!temporary_path_.empty()) ::unlink(temporary_path_.c_str());
}

Status AtomicFile::write(std::span<const std::byte> bytes) {
  FIG_CHECK(file_ != nullptr, "write after finish");
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size())
    return error("write failed", errno);
  return {};
}

int AtomicFile::descriptor() const {
  FIG_CHECK(file_ != nullptr, "descriptor after finish");
  return ::fileno(file_);
}

Status AtomicFile::finish() {
  if (file_ == nullptr) return {};
  const bool written = std::fflush(file_) == 0 && ::fsync(::fileno(file_)) == 0;
  const int code = errno;
  const bool closed = std::fclose(file_) == 0;
  const int close_code = errno;
  file_ = nullptr;
  if (!written) return error("write failed", code);
  if (!closed) return error("write failed", close_code);
  return {};
}

Status AtomicFile::commit() {
  FIG_CHECK(!temporary_path_.empty(), "commit twice");
  FIG_RETURN_IF_ERROR(finish());
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0)
    return error("cannot be renamed into place", errno);
  temporary_path_.clear();
  return {};
}

}  // namespace figurine::ports
