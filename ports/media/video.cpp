#include "ports/media/video.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <vector>

#include "ports/host/atomic_file.h"
#include "ports/media/ffmpeg_writer.h"
#include "ports/media/webp_writer.h"

namespace figurine::ports {

namespace {

struct Ending {
  const char* text;
  VideoKind kind;
};
constexpr Ending kEndings[] = {{".y4m", VideoKind::kY4m},
                               {".webp", VideoKind::kWebp},
                               {".mp4", VideoKind::kMp4},
                               {".webm", VideoKind::kWebm},
                               {".gif", VideoKind::kGif}};

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

}  // namespace

std::optional<VideoKind> video_kind(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Ending& known : kEndings) {
    if (ending == known.text) return known.kind;
  }
  return std::nullopt;
}

bool has_alpha(VideoKind kind) { return kind != VideoKind::kY4m && kind != VideoKind::kMp4; }

Result<std::unique_ptr<VideoWriter>> VideoWriter::create(const std::string& path,
                                                         const Options& options) {
  const std::optional<VideoKind> kind = video_kind(path);
  if (!kind) {
    return Status(StatusCode::kUnsupported,
                  path + ": moving pictures are written as .webp, .mp4, .webm, .gif or .y4m");
  }
  if (options.alpha && !has_alpha(*kind))
    return Status(StatusCode::kInvalidArgument, path + ": this kind of video has no alpha");
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file.ok()) return file.status();
  if (*kind == VideoKind::kWebp) return make_webp_writer(std::move(*file), options);
  if (*kind != VideoKind::kY4m) return make_ffmpeg_writer(std::move(*file), *kind, options);
  auto writer = std::make_unique<Y4mWriter>(std::move(*file));
  FIG_RETURN_IF_ERROR(writer->begin(options));
  return std::unique_ptr<VideoWriter>(std::move(writer));
}

}  // namespace figurine::ports
