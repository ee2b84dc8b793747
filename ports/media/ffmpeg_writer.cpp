#include "ports/media/ffmpeg_writer.h"

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

extern char** environ;

namespace figurine::ports {

namespace {

// Players want 4:2:0, which wants even sizes: an odd last row or column is repeated by the padding
// filter's neighbour, the scaler.
constexpr const char* kToVideo =
    "scale=ceil(iw/2)*2:ceil(ih/2)*2:flags=accurate_rnd+full_chroma_int:in_range=full:"
    "out_range=tv:out_color_matrix=bt709";
// A palette a frame: one for all would have ffmpeg hold all frames.
constexpr const char* kToPalettes =
    "split[a][b];[a]palettegen=stats_mode=single:reserve_transparent=1[p];"
    "[b][p]paletteuse=new=1:alpha_threshold=128";

std::vector<std::string> arguments_of(VideoKind kind, const VideoWriter::Options& options,
                                      const std::string& output) {
  std::vector<std::string> words = {"ffmpeg", "-hide_banner", "-loglevel",
                                    "error",  "-nostdin",     "-y"};
  const auto say = [&](std::initializer_list<std::string> more) {
    words.insert(words.end(), more);
  };
  say({"-f", "rawvideo", "-pix_fmt", options.alpha ? "rgba" : "rgb24", "-s",
       std::to_string(options.width_px) + "x" + std::to_string(options.height_px), "-r",
       std::to_string(options.rate.numerator) + "/" + std::to_string(options.rate.denominator),
       "-i", "pipe:0"});
  if (kind == VideoKind::kGif) {
    say({"-filter_complex", kToPalettes, "-f", "gif", output});
    return words;
  }
  say({"-vf", kToVideo});
  if (kind == VideoKind::kMp4) {
    say({"-c:v", "libx264", "-preset", "medium", "-crf", "16", "-pix_fmt", "yuv420p"});
  } else {
    say({"-c:v", "libvpx-vp9", "-deadline", "good", "-cpu-used", "4", "-row-mt", "1", "-crf", "20",
         "-b:v", "0", "-pix_fmt", options.alpha ? "yuva420p" : "yuv420p"});
  }
  say({"-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1",
       "-color_range", "tv"});
  if (kind == VideoKind::kMp4) say({"-movflags", "+faststart"});
  say({"-f", kind == VideoKind::kMp4 ? "mp4" : "webm", output});
  return words;
}

// Frames go to ffmpeg through a pipe; it writes the temporary of an AtomicFile. Its own process
// group keeps the terminal's interrupt from it, so that we decide what remains; its messages go to
// an unnamed file, so that neither side can block on them.
class FfmpegWriter : public VideoWriter {
 public:
  FfmpegWriter(AtomicFile file, VideoKind kind, const Options& options)
      : file_(std::move(file)), kind_(kind), options_(options) {}
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
    std::vector<std::string> words = arguments_of(kind_, options_, file_.temporary_path());
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
          file_.path() + ": needs ffmpeg, which is not installed; write a .webp or .y4m instead");
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
  VideoKind kind_;
  Options options_;
  pid_t process_ = -1;
  int pipe_ = -1;
  int messages_ = -1;
};

}  // namespace

Result<std::unique_ptr<VideoWriter>> make_ffmpeg_writer(AtomicFile file, VideoKind kind,
                                                        const VideoWriter::Options& options) {
  auto writer = std::make_unique<FfmpegWriter>(std::move(file), kind, options);
  FIG_RETURN_IF_ERROR(writer->start());
  return std::unique_ptr<VideoWriter>(std::move(writer));
}

}  // namespace figurine::ports
