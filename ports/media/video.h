// Moving pictures into one file from 8-bit frames: .y4m and animated .webp by figurine itself; .mp4
// (H.264), .webm (VP9) and .gif through an ffmpeg found on PATH. The file appears whole at finish()
// or not at all.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "figurine/status.h"
#include "ports/media/image.h"
#include "ports/media/y4m.h"

namespace figurine::ports {

enum class VideoKind : uint8_t { kY4m, kWebp, kMp4, kWebm, kGif };

// By the name's ending, in capitals or not; none of other names.
std::optional<VideoKind> video_kind(const std::string& path);
// Whether frames may have an alpha. A .gif has but on and off, from 128 on.
bool has_alpha(VideoKind kind);

class VideoWriter {
 public:
  struct Options {
    uint32_t width_px = 0;
    uint32_t height_px = 0;
    FrameRate rate;
    bool alpha = false;  // frames are RGBA, straight; else RGB
  };
  // The kind follows the name. kUnsupported for other names, and for those that need ffmpeg where
  // none is installed; kInvalidArgument for an alpha that the kind has no place for; kLimitExceeded
  // for a side beyond 16383 pixels of a .webp.
  static Result<std::unique_ptr<VideoWriter>> create(const std::string& path,
                                                     const Options& options);

  virtual ~VideoWriter() = default;  // without finish(): nothing remains
  // Of the size and the channels given.
  virtual Status add(const ImageU8& frame) = 0;
  virtual Status finish() = 0;
};

}  // namespace figurine::ports
