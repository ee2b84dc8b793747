// Pictures out of a video capture device: a camera. Whatever size the driver comes nearest to what
// is wanted in, as YUYV, NV12 or MJPEG; RGB is what one gets. Of several pictures that have come
// the newest counts, and the driver has the others again.
//
// YCbCr is read by the matrix and the range that the driver states (BT.601 in limited range if it
// states none). A picture that is broken, cut off or no JPEG is left out and counted.
//
// Errors name the device and the reason in a line: not there, not permitted, no video device, no
// capture, multi-planar alone, none of the formats, busy, and, while pictures come, gone (ENODEV)
// or broken (EIO).
//
// Based on: Linux Media Infrastructure userspace API, part I (Video for Linux API).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "figurine/status.h"
#include "ports/media/image.h"
#include "ports/v4l2/device.h"
#include "ports/v4l2/ycbcr_rows.h"

namespace figurine::ports {

class V4l2Capture {
 public:
  struct Options {
    uint32_t width_px = 640;  // wanted; the driver has the last word
    uint32_t height_px = 480;
    double frames_per_second = 30;
    uint64_t (*now_ns)() = nullptr;  // of deadlines; null: the steady clock
    VideoSystem* system = nullptr;   // null: video_system()
  };
  enum class Format : uint8_t { kYuyv, kNv12, kMjpeg };

  // Opens the device, agrees with it on everything and starts it.
  static Result<std::unique_ptr<V4l2Capture>> open(const std::string& path, const Options& options);
  V4l2Capture(const V4l2Capture&) = delete;
  V4l2Capture& operator=(const V4l2Capture&) = delete;

  Format format() const { return format_; }
  uint32_t width_px() const { return width_; }
  uint32_t height_px() const { return height_; }

  // The newest picture since the last call, RGB; waits for one until deadline_ns. False if none
  // came; picture is then what it was.
  Result<bool> next(ImageU8& picture, uint64_t deadline_ns);
  uint64_t broken_pictures() const { return broken_; }

 private:
  V4l2Capture(const std::string& path, const Options& options);
  Status check_device();
  Status agree_on_format();
  struct Agreed;
  Result<Agreed> try_format(Format format);
  // Whether the bytes were a picture.
  bool convert(size_t bytes, const std::byte* from, ImageU8& picture) const;

  Options options_;
  V4l2Device device_;
  Format format_ = Format::kYuyv;
  uint32_t width_ = 0, height_ = 0;
  size_t stride_bytes_ = 0, size_bytes_ = 0;
  YcbcrRows rows_{YcbcrMatrix::kBt601, false};
  uint64_t broken_ = 0;
};

}  // namespace figurine::ports
