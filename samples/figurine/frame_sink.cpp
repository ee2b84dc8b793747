#include "samples/figurine/frame_sink.h"

#include <deque>
#include <vector>

#include "ports/host/atomic_file.h"
#include "ports/media/pfm.h"
#include "ports/media/png.h"
#include "ports/media/video.h"

namespace figurine::samples {

namespace {

template <class T>
ports::Image<T> without_alpha(const ports::Image<T>& rgba) {
  ports::Image<T> rgb(rgba.width_px, rgba.height_px, 3);
  for (size_t i = 0; i < size_t(rgba.width_px) * rgba.height_px; ++i) {
    for (int c = 0; c < 3; ++c) rgb.pixels[3 * i + c] = rgba.pixels[4 * i + c];
  }
  return rgb;
}

// Images are complete temporaries until the last one is: then all get their names.
class ImageSink : public FrameSink {
 public:
  ImageSink(NumberedName name, PixelFormat format, bool opaque)
      : name_(std::move(name)), format_(format), opaque_(opaque) {}
  PixelFormat format() const override { return format_; }

  Status add(const RenderedFrame& frame) override {
    const Result<std::vector<std::byte>> bytes =
        format_ == PixelFormat::kRgbaF32
            ? ports::encode_pfm(opaque_ ? without_alpha(frame.f32) : frame.f32)
            : ports::encode_png(opaque_ ? without_alpha(frame.u8) : frame.u8);
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

class VideoSink : public FrameSink {
 public:
  explicit VideoSink(std::unique_ptr<ports::VideoWriter> writer) : writer_(std::move(writer)) {}
  Status add(const RenderedFrame& frame) override { return writer_->add(without_alpha(frame.u8)); }
  Status finish() override { return writer_->finish(); }

 private:
  std::unique_ptr<ports::VideoWriter> writer_;
};

}  // namespace

RenderedFrame::RenderedFrame(ImageSize size, PixelFormat pixel_format) : format(pixel_format) {
  if (format == PixelFormat::kRgba8) {
    u8 = ports::ImageU8(size.width_px, size.height_px, 4);
  } else {
    f32 = ports::ImageF32(size.width_px, size.height_px, 4);
  }
}

ImageTarget RenderedFrame::target() {
  if (format == PixelFormat::kRgba8)
    return {.pixels = u8.pixels.data(), .stride_bytes = size_t(u8.width_px) * 4, .format = format};
  return {.pixels = f32.pixels.data(),
          .stride_bytes = size_t(f32.width_px) * 4 * sizeof(float),
          .format = format};
}

bool is_video_name(const std::string& path) {
  return path.ends_with(".y4m") || path.ends_with(".mp4");
}

ports::ImageU8 drop_alpha(const ports::ImageU8& rgba) { return without_alpha(rgba); }

Result<std::unique_ptr<FrameSink>> FrameSink::create(const std::string& path,
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
    return std::unique_ptr<FrameSink>(std::make_unique<VideoSink>(std::move(*writer)));
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
  return std::unique_ptr<FrameSink>(std::make_unique<ImageSink>(
      std::move(*name), pfm ? PixelFormat::kRgbaF32 : PixelFormat::kRgba8, options.opaque));
}

}  // namespace figurine::samples
