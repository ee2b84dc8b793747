#include "samples/common/live_output.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "ports/host/clock.h"
#include "ports/host/process.h"
#include "samples/common/progress.h"
#include "samples/common/v4l2_sink.h"
#include "samples/common/window_sink.h"
#include "samples/common/y4m_pipe.h"

namespace figurine::samples {

namespace {

constexpr uint64_t kAsk_ns = 20'000'000;  // how often a FIFO is asked for its reader

enum class Target { kStandardOutput, kWindow, kVideoDevice, kFile, kStream };

Result<Target> target_of(const std::string& name) {
  const auto unsupported = [&](const std::string& why) {
    return Status(StatusCode::kUnsupported, name + ": " + why);
  };
  if (name == "-") return Target::kStandardOutput;
  if (name == "window") {
    FIG_RETURN_IF_ERROR(ports::Window::available());
    return Target::kWindow;
  }
  if (name.starts_with("/dev/video")) return Target::kVideoDevice;
  struct stat there{};
  const bool exists = ::stat(name.c_str(), &there) == 0;
  if (exists && (S_ISFIFO(there.st_mode) || S_ISCHR(there.st_mode))) return Target::kStream;
  if (exists && !S_ISREG(there.st_mode)) return unsupported("neither a file, a FIFO nor a device");
  if (!name.ends_with(".y4m"))
    return unsupported(
        "live video goes to - (standard output), window, /dev/videoN, a FIFO or x.y4m");
  return Target::kFile;
}

// A FIFO without a reader refuses to be opened without waiting; one that waits could not be
// interrupted, as the signal may reach another thread.
Result<int> open_stream(const std::string& name) {
  bool said = false;
  while (true) {
    const int descriptor = ::open(name.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor >= 0) return descriptor;
    if (errno != ENXIO && errno != EINTR)
      return Status(StatusCode::kIo, name + ": cannot be written: " + std::strerror(errno));
    if (!std::exchange(said, true)) ports::say(name + ": waiting for a reader");
    FIG_RETURN_IF_ERROR(check_interrupt());
    ports::sleep_until(ports::now_ns() + kAsk_ns);
  }
}

}  // namespace

Status LiveOutput::check(const std::string& name) { return target_of(name).status(); }

Result<LiveOutput> LiveOutput::open(const std::string& name, const Options& options) {
  const Result<Target> target = target_of(name);
  if (!target.ok()) return target.status();
  LiveOutput output;
  if (*target == Target::kVideoDevice) {
    Result<std::unique_ptr<V4l2Sink>> device =
        V4l2Sink::open(name, options.size, {.frames_per_second = options.frames_per_second});
    if (!device.ok()) return device.status();
    output.sink_ = std::move(*device);
    return output;
  }
  if (*target == Target::kWindow) {
    Result<std::unique_ptr<WindowSink>> window =
        WindowSink::open(options.size, {.frames_per_second = options.frames_per_second});
    if (!window.ok()) return window.status();
    output.sink_ = std::move(*window);
    return output;
  }
  int descriptor = STDOUT_FILENO;
  std::string shown = "standard output";
  if (*target == Target::kStandardOutput) {
    if (::isatty(STDOUT_FILENO) == 1) {
      return Status(StatusCode::kUnsupported,
                    "standard output: is a terminal; pipe it into what shows y4m, as in "
                    "figurine live ... -o - | ffplay -");
    }
  } else if (*target == Target::kFile) {
    Result<ports::AtomicFile> file = ports::AtomicFile::create(name);
    if (!file.ok()) return file.status();
    output.file_.emplace(std::move(file).value());
    descriptor = output.file_->descriptor();
    shown = name;
  } else {
    const Result<int> opened = open_stream(name);
    if (!opened.ok()) return opened.status();
    output.descriptor_ = descriptor = *opened;
    shown = name;
  }
  Result<std::unique_ptr<Y4mPipe>> pipe = Y4mPipe::create(
      descriptor, shown, options.size, {.frames_per_second = options.frames_per_second});
  if (!pipe.ok()) return pipe.status();
  output.sink_ = std::move(*pipe);
  return output;
}

LiveOutput::LiveOutput(LiveOutput&& other) noexcept
    : file_(std::move(other.file_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      sink_(std::move(other.sink_)) {}

LiveOutput::~LiveOutput() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Status LiveOutput::finish() {
  FIG_RETURN_IF_ERROR(sink_->finish());
  return file_ ? file_->commit() : Status();
}

}  // namespace figurine::samples
