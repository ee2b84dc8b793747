#include "ports/media/video.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>
#include <vector>

#include "ports/host/atomic_file.h"

extern char** environ;

namespace figurine::ports {

namespace {

class Y4mWriter : public VideoWriter {
 public:
  explicit Y4mWriter(AtomicFile file) : file_(std::move(file)) {}
  Status begin(const Options& options) {
    const std::string header = y4m_header(options.width_px, options.height_px, options.rate);
    return file_.write(std::as_bytes(std::span(header)));
  }
  Status add(const ImageU8& frame) override {
    buffer_.clear();
    append_y4m_frame(frame, buffer_);
    return file_.write(buffer_);
  }
  Status finish() override { return file_.commit(); }

 private:
  AtomicFile file_;
  std::vector<std::byte> buffer_;
};

// Frames go to ffmpeg through a pipe; it writes the temporary of an AtomicFile. Its own process
// group keeps the terminal's interrupt from it, so that we decide what remains; its messages go to
// an unnamed file, so that neither side can block on them.
class FfmpegWriter : public VideoWriter {
 public:
  FfmpegWriter(AtomicFile file, const Options& options)
      : file_(std::move(file)), options_(options) {}
  ~FfmpegWriter() override {
    close_pipe();
    if (process_ > 0) {
      ::kill(process_, SIGKILL);
      ::waitpid(process_, nullptr, 0);
    }
    if (messages_ >= 0) ::close(messages_);
  }

  Status start() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
      return Status(StatusCode::kIo, std::string("ffmpeg: pipe: ") + std::strerror(errno));
    pipe_ = ends[1];
    messages_ = ::memfd_create("ffmpeg-messages", MFD_CLOEXEC);
    const std::string size =
        std::to_string(options_.width_px) + "x" + std::to_string(options_.height_px);
    const std::string rate =
        std::to_string(options_.rate.numerator) + "/" + std::to_string(options_.rate.denominator);
    // Players want 4:2:0, which wants even sizes: an odd last row or column is repeated by the
    // padding filter's neighbour, the scaler.
    const std::string filter =
        "scale=ceil(iw/2)*2:ceil(ih/"
        "2)*2:flags=accurate_rnd+full_chroma_int:in_range=full:out_range=tv:out_color_matrix=bt709";
    std::vector<std::string> words = {"ffmpeg",
                                      "-hide_banner",
                                      "-loglevel",
                                      "error",
                                      "-nostdin",
                                      "-y",
                                      "-f",
                                      "rawvideo",
                                      "-pix_fmt",
                                      "rgb24",
                                      "-s",
                                      size,
                                      "-r",
                                      rate,
                                      "-i",
                                      "pipe:0",
                                      "-vf",
                                      filter,
                                      "-c:v",
                                      "libx264",
                                      "-preset",
                                      "medium",
                                      "-crf",
                                      "16",
                                      "-pix_fmt",
                                      "yuv420p",
                                      "-colorspace",
                                      "bt709",
                                      "-color_primaries",
                                      "bt709",
                                      "-color_trc",
                                      "iec61966-2-1",
                                      "-color_range",
                                      "tv",
                                      "-movflags",
                                      "+faststart",
                                      "-f",
                                      "mp4",
                                      file_.temporary_path()};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    if (messages_ >= 0) posix_spawn_file_actions_adddup2(&actions, messages_, STDERR_FILENO);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes, 0);
    const int code =
        ::posix_spawnp(&process_, "ffmpeg", &actions, &attributes, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    ::close(ends[0]);
    if (code == 0) return {};
    process_ = -1;
    if (code == ENOENT) {
      return Status(
          StatusCode::kUnsupported,
          file_.path() + ": .mp4 needs ffmpeg, which is not installed; write a .y4m instead");
    }
    return Status(StatusCode::kIo, std::string("ffmpeg: ") + std::strerror(code));
  }

  Status add(const ImageU8& frame) override {
    const uint8_t* data = frame.pixels.data();
    size_t left = frame.pixels.size();
    while (left > 0) {
      const ssize_t written = ::write(pipe_, data, left);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0)
        return reap();  // EPIPE: ffmpeg has ended, it says why (callers ignore SIGPIPE)
      data += written;
      left -= static_cast<size_t>(written);
    }
    return {};
  }

  Status finish() override {
    close_pipe();
    FIG_RETURN_IF_ERROR(reap());
    return file_.commit();
  }

 private:
  void close_pipe() {
    if (pipe_ >= 0) ::close(pipe_);
    pipe_ = -1;
  }

  // Waits for ffmpeg; an error unless it ended well after all frames were given.
  Status reap() {
    const bool all_given = pipe_ < 0;
    close_pipe();
    int status = 0;
    while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = -1;
    if (all_given && WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
    return Status(StatusCode::kIo, file_.path() + ": ffmpeg failed: " + last_message());
  }

  std::string last_message() const {
    char text[4096];
    const off_t size = messages_ < 0 ? 0 : ::lseek(messages_, 0, SEEK_END);
    const off_t from = std::max<off_t>(0, size - static_cast<off_t>(sizeof(text)));
    const ssize_t count = messages_ < 0 ? 0 : ::pread(messages_, text, sizeof(text), from);
    std::string_view view(text, count > 0 ? static_cast<size_t>(count) : 0);
    while (!view.empty() && view.back() == '\n') view.remove_suffix(1);
    view = view.substr(view.rfind('\n') == std::string_view::npos ? 0 : view.rfind('\n') + 1);
    return view.empty() ? "it said nothing" : std::string(view);
  }

  AtomicFile file_;
  Options options_;
  pid_t process_ = -1;
  int pipe_ = -1;
  int messages_ = -1;
};

bool ends_with(const std::string& path, std::string_view ending) {
  return path.size() > ending.size() && path.ends_with(ending);
}

}  // namespace

Result<std::unique_ptr<VideoWriter>> VideoWriter::create(const std::string& path,
                                                         const Options& options) {
  const bool y4m = ends_with(path, ".y4m");
  if (!y4m && !ends_with(path, ".mp4"))
    return Status(StatusCode::kUnsupported, path + ": video is written as .y4m or .mp4");
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file.ok()) return file.status();
  if (y4m) {
    auto writer = std::make_unique<Y4mWriter>(std::move(*file));
    FIG_RETURN_IF_ERROR(writer->begin(options));
    return std::unique_ptr<VideoWriter>(std::move(writer));
  }
  auto writer = std::make_unique<FfmpegWriter>(std::move(*file), options);
  FIG_RETURN_IF_ERROR(writer->start());
  return std::unique_ptr<VideoWriter>(std::move(writer));
}

}  // namespace figurine::ports
