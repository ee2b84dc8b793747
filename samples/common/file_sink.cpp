#include "samples/common/file_sink.h"

#include <algorithm>
#include <cctype>
#include <deque>
#include <filesystem>
#include <vector>

#include "ports/host/atomic_file.h"
#include "ports/host/files.h"
#include "ports/media/jpeg.h"
#include "ports/media/pfm.h"
#include "ports/media/png.h"
#include "ports/media/video.h"

namespace figurine::samples {

namespace {

constexpr int kJpegQuality = 92;

enum class PictureKind : uint8_t { kPng, kJpeg, kPfm };

std::optional<PictureKind> picture_kind(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".png") return PictureKind::kPng;
  if (ending == ".jpg" || ending == ".jpeg") return PictureKind::kJpeg;
  if (ending == ".pfm") return PictureKind::kPfm;
  return std::nullopt;
}

Result<std::vector<std::byte>> encode(PictureKind kind, const ports::ImageU8& rgba, bool opaque) {
  if (kind == PictureKind::kJpeg) return ports::encode_jpeg(drop_alpha(rgba), kJpegQuality);
  return ports::encode_png(opaque ? drop_alpha(rgba) : rgba);
}

// Images are complete temporaries until the last one is: then all get their names.
class ImageSink : public FileSink {
 public:
  ImageSink(NumberedName name, PictureKind kind, bool opaque)
      : name_(std::move(name)), kind_(kind), opaque_(opaque) {}
  PixelFormat format() const override {
    return kind_ == PictureKind::kPfm ? PixelFormat::kRgbaF32 : PixelFormat::kRgba8;
  }

  Status add(const RenderedFrame& frame, uint32_t number) override {
    const Result<std::vector<std::byte>> bytes =
        kind_ == PictureKind::kPfm ? ports::encode_pfm(opaque_ ? drop_alpha(frame.f32) : frame.f32)
                                   : encode(kind_, frame.u8, opaque_);
    if (!bytes.ok()) return bytes.status();
    Result<ports::AtomicFile> file = ports::AtomicFile::create(name_.name(number));
    if (!file.ok()) return file.status();
    files_.push_back(std::move(*file));
    FIG_RETURN_IF_ERROR(files_.back().write(*bytes));
    return files_.back().finish();
  }

  Status finish() override {
    for (ports::AtomicFile& file : files_) FIG_RETURN_IF_ERROR(file.commit());
    return {};
  }

 private:
  NumberedName name_;
  PictureKind kind_;
  bool opaque_;
  std::deque<ports::AtomicFile> files_;
};

class VideoSink : public FileSink {
 public:
  VideoSink(std::unique_ptr<ports::VideoWriter> writer, bool opaque)
      : writer_(std::move(writer)), opaque_(opaque) {}
  Status add(const RenderedFrame& frame, uint32_t) override {
    return writer_->add(opaque_ ? drop_alpha(frame.u8) : frame.u8);
  }
  Status finish() override { return writer_->finish(); }

 private:
  std::unique_ptr<ports::VideoWriter> writer_;
  bool opaque_;
};

}  // namespace

bool is_video_name(const std::string& path) { return ports::video_kind(path).has_value(); }

bool needs_background(const std::string& path) {
  const std::optional<ports::VideoKind> video = ports::video_kind(path);
  return video ? !ports::has_alpha(*video) : picture_kind(path) == PictureKind::kJpeg;
}

Status check_picture_name(const std::string& path) {
  const std::optional<PictureKind> kind = picture_kind(path);
  if (kind && kind != PictureKind::kPfm) return {};
  return Status(StatusCode::kUnsupported, path + ": such a picture is written as .png or .jpg");
}

Status write_picture(const std::string& path, const ports::ImageU8& rgba, bool opaque) {
  FIG_RETURN_IF_ERROR(check_picture_name(path));
  const Result<std::vector<std::byte>> bytes = encode(*picture_kind(path), rgba, opaque);
  if (!bytes.ok()) return bytes.status().within(path);
  return ports::write_file_atomically(path, *bytes);
}

Result<std::unique_ptr<FileSink>> FileSink::create(const std::string& path,
                                                   const Options& options) {
  if (path.starts_with("/dev/video"))
    return Status(StatusCode::kUnsupported,
                  path + ": a video device shows what figurine live draws");
  if (needs_background(path) && !options.opaque) {
    return Status(StatusCode::kInvalidArgument,
                  path + ": has no alpha; give a --background colour");
  }
  if (is_video_name(path)) {
    const Result<ports::FrameRate> rate = ports::make_frame_rate(options.frames_per_second);
    if (!rate.ok()) return rate.status().within(path);
    Result<std::unique_ptr<ports::VideoWriter>> writer =
        ports::VideoWriter::create(path, {.width_px = options.size.width_px,
                                          .height_px = options.size.height_px,
                                          .rate = *rate,
                                          .alpha = !options.opaque});
    if (!writer.ok()) return writer.status();
    return std::unique_ptr<FileSink>(
        std::make_unique<VideoSink>(std::move(*writer), options.opaque));
  }
  const std::optional<PictureKind> kind = picture_kind(path);
  if (!kind) {
    return Status(
        StatusCode::kUnsupported,
        path + ": output is written as .png, .jpg, .pfm, .webp, .mp4, .webm, .gif or .y4m");
  }
  Result<NumberedName> name = NumberedName::parse(path);
  if (!name.ok()) return name.status();
  if (options.frame_count > 1 && !name->numbered()) {
    return Status(StatusCode::kInvalidArgument, path + ": one image cannot hold " +
                                                    std::to_string(options.frame_count) +
                                                    " frames; number them, as in x_%04d.png");
  }
  // Tried now, not after the first frame was rendered.
  const Result<ports::AtomicFile> probe = ports::AtomicFile::create(name->name(0));
  if (!probe.ok()) return probe.status();
  return std::unique_ptr<FileSink>(
      std::make_unique<ImageSink>(std::move(*name), *kind, options.opaque));
}

}  // namespace figurine::samples
