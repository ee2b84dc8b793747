// Where rendered frames go: one image, numbered images, or a video. Everything appears at finish(),
// together, or not at all.
#pragma once

#include <memory>
#include <string>

#include "figurine/renderer.h"
#include "ports/media/image.h"
#include "ports/media/y4m.h"
#include "samples/figurine/parse.h"

namespace figurine::samples {

// A frame as the renderer wrote it, RGBA with straight alpha, in the one of the two forms that the
// sink asked for.
struct RenderedFrame {
  ports::ImageU8 u8;
  ports::ImageF32 f32;

  RenderedFrame(ImageSize size, PixelFormat pixel_format);
  ImageTarget target();
  PixelFormat format;
};

class FrameSink {
 public:
  struct Options {
    ImageSize size;
    uint32_t frame_count = 1;
    double frames_per_second = 30;
    bool opaque = false;  // a background was drawn: images are RGB instead of RGBA
  };
  // By the name: .png and .pfm (with %d or %04d for more than one frame, numbered from 0), .y4m,
  // .mp4. kUnsupported for other names and for /dev/video*, kInvalidArgument for several frames
  // into one image, or a video without a background.
  static Result<std::unique_ptr<FrameSink>> create(const std::string& path, const Options& options);

  virtual ~FrameSink() = default;  // without finish(): nothing remains
  virtual PixelFormat format() const { return PixelFormat::kRgba8; }
  virtual Status add(const RenderedFrame& frame) = 0;
  virtual Status finish() = 0;
};

// Whether a name means a video: those have no alpha and show their background.
bool is_video_name(const std::string& path);

// Red, green and blue without alpha.
ports::ImageU8 drop_alpha(const ports::ImageU8& rgba);

}  // namespace figurine::samples
