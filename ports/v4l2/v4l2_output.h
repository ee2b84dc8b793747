// Frames into a video output device: a virtual camera (v4l2loopback) or a real output.
//
// Of the formats that the device offers the first of YUYV, NV12, RGB24 and BGR24 that the size
// allows; of these two with YCbCr codes by BT.601 in limited range, as the device is told and as
// programs that read a camera take for granted. Streaming I/O with the driver's own buffers, its
// stride and its count. A frame that finds no free buffer in time is the caller's to drop.
//
// Errors name the device and the reason in a line: not there, not permitted, no video device, no
// output, multi-planar alone, none of the formats, another size, busy, and, while frames go out,
// gone (ENODEV) or broken (EIO).
//
// Based on: Linux Media Infrastructure userspace API, part I (Video for Linux API).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "figurine/frame.h"
#include "figurine/status.h"
#include "ports/v4l2/device.h"

namespace figurine::ports {

class V4l2Output {
 public:
  static constexpr YcbcrMatrix kMatrix = YcbcrMatrix::kBt601;
  struct Options {
    uint32_t width_px = 0;
    uint32_t height_px = 0;
    double frames_per_second = 30;
    std::optional<PixelFormat> format;  // none: the first that the device and the size allow
    uint64_t (*now_ns)() = nullptr;     // of deadlines; null: the steady clock
    VideoSystem* system = nullptr;      // null: video_system()
  };
  // Opens the device and agrees with it on everything; shows nothing yet.
  static Result<std::unique_ptr<V4l2Output>> open(const std::string& path, const Options& options);
  PixelFormat format() const { return format_; }
  size_t stride_bytes() const { return stride_bytes_; }
  size_t buffer_count() const { return device_.buffer_count(); }

  // Gives the driver a frame: rows of format() without padding, chroma of NV12 behind the luma,
  // exactly as many bytes as that is (FIG_CHECK). Waits for a free buffer until deadline_ns; false
  // if there was none.
  Result<bool> show(std::span<const uint8_t> pixels, uint64_t deadline_ns);
  // Buffers that the driver gave back as broken.
  uint64_t broken_buffers() const { return broken_; }

 private:
  V4l2Output(const std::string& path, const Options& options);
  Status check_device();
  Status agree_on_format();
  Status try_format(PixelFormat format, bool& agreed);
  // The number of a buffer that is free, or -1 at the deadline.
  Result<int> free_buffer(uint64_t deadline_ns);
  void copy(std::span<const uint8_t> pixels, std::byte* to) const;

  Options options_;
  V4l2Device device_;
  PixelFormat format_ = PixelFormat::kYuyv;
  size_t stride_bytes_ = 0, size_bytes_ = 0;
  uint64_t broken_ = 0;
};

}  // namespace figurine::ports
