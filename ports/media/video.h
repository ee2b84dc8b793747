// Video files from RGB frames: .y4m by figurine itself, .mp4 (H.264) through an ffmpeg found on
// PATH. The file appears whole at finish() or not at all.
#pragma once

#include <memory>
#include <string>

#include "figurine/status.h"
#include "ports/media/image.h"
#include "ports/media/y4m.h"

namespace figurine::ports {

class VideoWriter {
 public:
  struct Options {
    uint32_t width_px = 0;
    uint32_t height_px = 0;
    FrameRate rate;
  };
  // The kind follows the name: .y4m or .mp4. kUnsupported for other names, and for .mp4 where no
  // ffmpeg with an H.264 encoder is installed.
  static Result<std::unique_ptr<VideoWriter>> create(const std::string& path,
                                                     const Options& options);

  virtual ~VideoWriter() = default;  // without finish(): nothing remains
  // RGB, 3 channels, of the size given.
  virtual Status add(const ImageU8& frame) = 0;
  virtual Status finish() = 0;
};

}  // namespace figurine::ports
