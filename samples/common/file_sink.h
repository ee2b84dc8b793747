// Frames into files: one image, numbered images, or a video. Everything appears at finish(),
// together, or not at all. For frames that somebody watches as they come: live_sink.h.
#pragma once

#include <array>
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
  // By the name's ending, in capitals or not: .png, .jpg and .pfm (with %d or %04d for more than
  // one frame), and what ports::VideoWriter knows. kUnsupported for other names and for
  // /dev/video*, kInvalidArgument for several frames into one image, or what has no alpha without a
  // background.
  static Result<std::unique_ptr<FileSink>> create(const std::string& path, const Options& options);

  virtual ~FileSink() = default;  // without finish(): nothing remains
  virtual PixelFormat format() const { return PixelFormat::kRgba8; }
  // number: of the frame in its sequence, for numbered images; of one sink never the same twice.
  virtual Status add(const RenderedFrame& frame, uint32_t number) = 0;
  virtual Status finish() = 0;
};

// Behind figures where a file has no alpha and nothing was asked for: a light, slightly cool grey,
// before which dark and light clothes stand out.
inline constexpr std::array<float, 3> kPlainBackground{0.86f, 0.88f, 0.90f};

// Whether a name means a file of moving pictures.
bool is_video_name(const std::string& path);
// Whether a name means a kind of file that has no alpha.
bool needs_background(const std::string& path);

// A picture into a .png or, opaque, a .jpg, by the name. kUnsupported for other names.
Status check_picture_name(const std::string& path);
Status write_picture(const std::string& path, const ports::ImageU8& rgba, bool opaque);

}  // namespace figurine::samples
