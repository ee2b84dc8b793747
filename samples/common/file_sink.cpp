#include "samples/common/file_sink.h"

#include <deque>
#include <vector>

#include "ports/host/atomic_file.h"
#include "ports/media/pfm.h"
#include "ports/media/png.h"
#include "ports/media/video.h"

namespace figurine::samples {

namespace {

// Images are complete temporaries until the last one is: then all get their names.
class ImageSink : public FileSink {
 public:
  ImageSink(NumberedName name, PixelFormat format, bool opaque)
      : name_(std::move(name)), format_(format), opaque_(opaque) {}
  PixelFormat format() const override { return format_; }

  Status add(const RenderedFrame& frame) override {
    const Result<std::vector<std::byte>> bytes =
        format_ == PixelFormat::kRgbaF32
            ? ports::encode_pfm(opaque_ ? drop_alpha(frame.f32) : frame.f32)
            : ports::encode_png(opaque_ ? drop_alpha(frame.u8) : frame.u8);
    if (!bytes.ok()) return bytes.status();
    Result<ports::AtomicFile> file =
        ports::AtomicFile::create(name_.name(static_cast<uint32_t>(files_.size())));
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
  PixelFormat format_;
  bool opaque_;
  std::deque<ports::AtomicFile> files_;
};

class VideoSink : public FileSink {
 public:
  explicit VideoSink(std::unique_ptr<ports::VideoWriter> writer) : writer_(std::move(writer)) {}
  Status add(const RenderedFrame& frame) override { return writer_->add(drop_alpha(frame.u8)); }
  Status finish() override { return writer_->finish(); }

 private:
  std::unique_ptr<ports::VideoWriter> writer_;
};

}  // namespace

bool is_video_name(const std::string& path) {
  return path.ends_with(".y4m") || path.ends_with(".mp4");
}

Result<std::unique_ptr<FileSink>> FileSink::create(const std::string& path,
                                                   const Options& options) {
  if (path.starts_with("/dev/video"))
    return Status(StatusCode::kUnsupported, path + ": video devices are unsupported in this build");
  if (is_video_name(path)) {
    if (!options.opaque)
      return Status(StatusCode::kInvalidArgument,
                    path + ": video has no alpha; give a --background colour");
    const Result<ports::FrameRate> rate = ports::make_frame_rate(options.frames_per_second);
    if (!rate.ok()) return rate.status().within(path);
    Result<std::unique_ptr<ports::VideoWriter>> writer = ports::VideoWriter::create(
        path,
        {.width_px = options.size.width_px, .height_px = options.size.height_px, .rate = *rate});
    if (!writer.ok()) return writer.status();
    return std::unique_ptr<FileSink>(std::make_unique<VideoSink>(std::move(*writer)));
  }
  const bool pfm = path.ends_with(".pfm");
  if (!pfm && !path.ends_with(".png")) {
    return Status(StatusCode::kUnsupported,
                  path + ": output is written as .png, .pfm, .y4m or .mp4");
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
  return std::unique_ptr<FileSink>(std::make_unique<ImageSink>(
      std::move(*name), pfm ? PixelFormat::kRgbaF32 : PixelFormat::kRgba8, options.opaque));
}

}  // namespace figurine::samples
