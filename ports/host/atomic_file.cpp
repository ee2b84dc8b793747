#include "ports/host/atomic_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "ports/host/system_error.h"

namespace figurine::ports {

namespace {

namespace fs = std::filesystem;

constexpr char kEnding[] = ".figurine.tmp";
constexpr size_t kMostOfName = 100;  // bytes of the file's name in its temporary's
constexpr int kMostLinks = 40;       // as the kernel follows
constexpr int kMostTries = 1000;
constexpr std::time_t kOld_s = 24 * 60 * 60;

// Eight digits for where process numbers mean the same: this machine, since it was started, in this
// space of process numbers.
const std::string& place_of_processes() {
  static const std::string place = [] {
    std::string text;
    std::ifstream("/proc/sys/kernel/random/boot_id") >> text;
    char space[64];
    const ssize_t length = ::readlink("/proc/self/ns/pid", space, sizeof(space));
    if (length > 0) text.append(space, static_cast<size_t>(length));
    uint32_t hash = 2166136261u;  // FNV-1a
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
    std::string digits(8, '0');
    for (char& digit : digits) digit = "0123456789abcdef"[hash >> 28], hash <<= 4;
    return digits;
  }();
  return place;
}

// ".NAME.PLACE-PROCESS-NUMBER.figurine.tmp"
std::string temporary_name(const std::string& name) {
  static std::atomic<unsigned> counter{0};
  return "." + name.substr(0, kMostOfName) + "." + place_of_processes() + "-" +
         std::to_string(::getpid()) + "-" + std::to_string(counter++) + kEnding;
}

// Where a symbolic link leads, also if nothing is there yet.
std::string behind_links(std::string path) {
  for (int i = 0; i < kMostLinks; ++i) {
    std::error_code error;
    const fs::path next = fs::read_symlink(path, error);
    if (error) return path;
    path = next.is_absolute() ? next.string() : (fs::path(path).parent_path() / next).string();
  }
  return path;  // a loop; opening it says so
}

std::string folder_of(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

bool is_left_over(const std::string& path, const std::string& name) {
  const size_t end = name.size() - (sizeof(kEnding) - 1), dot = name.rfind('.', end - 1);
  struct stat info{};
  if (dot == std::string::npos || ::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode))
    return false;
  const std::string owner = name.substr(dot + 1, end - dot - 1);  // PLACE-PROCESS-NUMBER
  const size_t first = owner.find('-');
  if (first == std::string::npos) return false;
  pid_t process = 0;
  const char* number = owner.data() + first + 1;
  const auto parsed = std::from_chars(number, owner.data() + owner.size(), process);
  if (parsed.ec != std::errc{} || parsed.ptr == number || process <= 0) return false;
  if (owner.compare(0, first, place_of_processes()) == 0)
    return ::kill(process, 0) != 0 && errno == ESRCH;
  return std::time(nullptr) - info.st_mtime > kOld_s;
}

// The first time that this process writes into a folder.
void sweep_once(const std::string& folder) {
  static std::mutex mutex;
  static std::set<std::tuple<uint64_t, uint64_t, std::string>> swept;  // numbers are used again
  struct stat info{};
  if (::stat(folder.c_str(), &info) != 0) return;
  {
    const std::lock_guard<std::mutex> guard(mutex);
    if (!swept.emplace(info.st_dev, info.st_ino, folder).second) return;
  }
  sweep_temporaries(folder);
}

int sync(int fd) {
  while (::fsync(fd) != 0) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

// The new name is on disk once its folder is. Some file systems cannot sync folders (EINVAL): the
// file is complete either way.
int sync_folder(const std::string& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return 0;
  const int error = sync(fd);
  ::close(fd);
  return error == EINVAL ? 0 : error;
}

}  // namespace

void sweep_temporaries(const std::string& folder) {
  std::vector<std::string> left;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with('.') && name.ends_with(kEnding) && is_left_over(it->path().string(), name))
      left.push_back(it->path().string());
  }
  for (const std::string& path : left) ::unlink(path.c_str());
}

Result<AtomicFile> AtomicFile::create(const std::string& path) {
  AtomicFile result;
  result.path_ = path;
  result.target_ = behind_links(path);
  struct stat existing{};
  if (::lstat(result.target_.c_str(), &existing) == 0 && S_ISLNK(existing.st_mode))
    return system_error(path, "cannot write", ELOOP);
  // rename() would say "Is a directory" only after everything was written, and would replace a
  // device node by a file.
  if (::stat(result.target_.c_str(), &existing) == 0 && !S_ISREG(existing.st_mode)) {
    return S_ISDIR(existing.st_mode)
               ? system_error(path, "cannot write", EISDIR)
               : Status(StatusCode::kIo, path + ": cannot write: not a regular file");
  }
  const fs::path place(result.target_);
  if (!place.has_filename()) return Status(StatusCode::kInvalidArgument, path + ": names no file");
  sweep_once(folder_of(result.target_));
  for (int tries = 0; result.file_ < 0; ++tries) {
    const std::string temporary =
        (place.parent_path() / temporary_name(place.filename().string())).string();
    result.file_ = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (result.file_ >= 0) {
      result.temporary_path_ = temporary;
    } else if ((errno != EEXIST && errno != EINTR) || tries == kMostTries) {
      return system_error(path, "cannot create", errno);
    }
  }
  return result;
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      temporary_path_(std::move(other.temporary_path_)),
      file_(std::exchange(other.file_, -1)) {
  other.temporary_path_.clear();
}

AtomicFile::~AtomicFile() {
  if (file_ >= 0) ::close(file_);
  if (!temporary_path_.empty()) ::unlink(temporary_path_.c_str());
}

Status AtomicFile::write(std::span<const std::byte> bytes) {
  FIG_CHECK(file_ >= 0, "write after finish");
  while (!bytes.empty()) {
    const ssize_t written =
        ::write(file_, bytes.data(), std::min<size_t>(bytes.size(), size_t{1} << 30));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return system_error(path_, "cannot write", written < 0 ? errno : EIO);
    bytes = bytes.subspan(static_cast<size_t>(written));
  }
  return {};
}

int AtomicFile::descriptor() const {
  FIG_CHECK(file_ >= 0, "descriptor after finish");
  return file_;
}

// Closing can report a late write error.
Status AtomicFile::close(bool sync_first) {
  if (file_ < 0) return {};
  int error = sync_first ? sync(file_) : 0;
  if (::close(std::exchange(file_, -1)) != 0 && error == 0 && errno != EINTR) error = errno;
  return error == 0 ? Status() : system_error(path_, "cannot write", error);
}

Status AtomicFile::rename() {
  FIG_CHECK(!temporary_path_.empty(), "commit twice");
  if (::rename(temporary_path_.c_str(), target_.c_str()) != 0)
    return system_error(path_, "cannot write", errno);
  temporary_path_.clear();
  return {};
}

Status AtomicFile::finish() { return close(true); }

Status AtomicFile::commit() {
  FIG_RETURN_IF_ERROR(finish());
  FIG_RETURN_IF_ERROR(rename());
  const int error = sync_folder(folder_of(target_));
  return error == 0 ? Status() : system_error(path_, "cannot sync the folder", error);
}

Status AtomicFile::commit_unsynced() {
  FIG_RETURN_IF_ERROR(close(false));
  return rename();
}

}  // namespace figurine::ports
