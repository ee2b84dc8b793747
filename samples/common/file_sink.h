// Frames into files: one image, numbered images, or a video. Everything appears at finish(),
// together, or not at all. For frames that somebody watches as they come: live_sink.h.
#pragma once

#include <memory>
#include <string>

#include "samples/common/rendered_frame.h"

namespace figurine::samples {

class FileSink {
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
  static Result<std::unique_ptr<FileSink>> create(const std::string& path, const Options& options);

  virtual ~FileSink() = default;  // without finish(): nothing remains
  virtual PixelFormat format() const { return PixelFormat::kRgba8; }
  virtual Status add(const RenderedFrame& frame) = 0;
  virtual Status finish() = 0;
};

// Whether a name means a video: those have no alpha and show their background.
bool is_video_name(const std::string& path);

}  // namespace figurine::samples
