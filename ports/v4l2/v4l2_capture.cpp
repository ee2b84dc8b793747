#include "ports/v4l2/v4l2_capture.h"

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <span>
#include <vector>

#include "ports/media/jpeg.h"

namespace figurine::ports {

namespace {

constexpr uint32_t kCaptureBuffers = 3;  // one being read, one that is newer, one being filled
constexpr uint32_t kLargestSide = 16384;
constexpr size_t kMostPictureBytes = size_t{1} << 30;

// In the order in which they are tried: raw pictures cost no decoder.
struct CaptureFormat {
  V4l2Capture::Format format;
  uint32_t code;  // V4L2's
};
constexpr CaptureFormat kCaptureFormats[] = {
    {V4l2Capture::Format::kYuyv, V4L2_PIX_FMT_YUYV},
    {V4l2Capture::Format::kNv12, V4L2_PIX_FMT_NV12},
    {V4l2Capture::Format::kMjpeg, V4L2_PIX_FMT_MJPEG},
};

// Bytes of a row without padding: pixels share chroma in pairs, and an odd one has a pair's.
size_t row_bytes(V4l2Capture::Format format, uint32_t width) {
  const size_t even = (size_t{width} + 1) / 2 * 2;
  return format == V4l2Capture::Format::kYuyv ? 2 * even : even;
}

size_t rows_of(V4l2Capture::Format format, uint32_t height) {
  return format == V4l2Capture::Format::kYuyv ? height : size_t{height} + (height + 1) / 2;
}

YcbcrRows rows_by(const v4l2_pix_format& pix) {
  const auto space = static_cast<v4l2_colorspace>(pix.colorspace);
  const uint32_t encoding = pix.ycbcr_enc != V4L2_YCBCR_ENC_DEFAULT
                                ? pix.ycbcr_enc
                                : uint32_t{V4L2_MAP_YCBCR_ENC_DEFAULT(space)};
  const uint32_t range = pix.quantization != V4L2_QUANTIZATION_DEFAULT
                             ? pix.quantization
                             : uint32_t{V4L2_MAP_QUANTIZATION_DEFAULT(false, space, encoding)};
  return YcbcrRows(encoding == V4L2_YCBCR_ENC_709 ? YcbcrMatrix::kBt709 : YcbcrMatrix::kBt601,
                   range == V4L2_QUANTIZATION_FULL_RANGE);
}

}  // namespace

// What a driver made of a format that was asked for; none taken: width 0.
struct V4l2Capture::Agreed {
  Format format = Format::kYuyv;
  uint32_t width = 0, height = 0;
  size_t stride_bytes = 0, size_bytes = 0;
  YcbcrRows rows{YcbcrMatrix::kBt601, false};

  uint64_t pixels() const { return uint64_t{width} * height; }
};

V4l2Capture::V4l2Capture(const std::string& path, const Options& options)
    : options_(options),
      device_(path, V4L2_BUF_TYPE_VIDEO_CAPTURE, options.now_ns, options.system) {}

Result<std::unique_ptr<V4l2Capture>> V4l2Capture::open(const std::string& path,
                                                       const Options& options) {
  std::unique_ptr<V4l2Capture> capture(new V4l2Capture(path, options));
  V4l2Device& device = capture->device_;
  FIG_RETURN_IF_ERROR(device.open("reading"));
  FIG_RETURN_IF_ERROR(capture->check_device());
  FIG_RETURN_IF_ERROR(capture->agree_on_format());
  FIG_RETURN_IF_ERROR(device.wish_rate(options.frames_per_second));
  FIG_RETURN_IF_ERROR(device.take_buffers(kCaptureBuffers, capture->size_bytes_));
  for (uint32_t i = 0; i < device.buffer_count(); ++i) FIG_RETURN_IF_ERROR(device.queue(i, 0));
  FIG_RETURN_IF_ERROR(device.start());
  return capture;
}

Status V4l2Capture::check_device() {
  const Result<uint32_t> caps = device_.capabilities();
  if (!caps.ok()) return caps.status();
  if ((*caps & V4L2_CAP_VIDEO_CAPTURE) == 0) {
    return device_.unsupported(
        (*caps & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0
            ? "gives pictures in several planes only, which figurine does not read"
            : "is no camera");
  }
  if ((*caps & V4L2_CAP_STREAMING) == 0) return device_.unsupported("has no streaming of frames");
  return {};
}

// The first format whose pictures are as large as wanted; else that with the largest ones. Cameras
// have large pictures as MJPEG alone.
Status V4l2Capture::agree_on_format() {
  const std::vector<uint32_t> offered = device_.offered_formats();
  Agreed best;
  for (const CaptureFormat& each : kCaptureFormats) {
    if (std::find(offered.begin(), offered.end(), each.code) == offered.end()) continue;
    const Result<Agreed> agreed = try_format(each.format);
    if (!agreed.ok()) return agreed.status();
    if (agreed->pixels() > best.pixels()) best = *agreed;
    if (best.width >= options_.width_px && best.height >= options_.height_px) break;
  }
  if (best.width == 0) return device_.unsupported("gives none of YUYV, NV12 and MJPEG");
  // Another one may have been set since.
  const Result<Agreed> again = try_format(best.format);
  if (!again.ok()) return again.status();
  if (again->width == 0) return device_.unsupported("gives none of YUYV, NV12 and MJPEG");
  format_ = again->format, width_ = again->width, height_ = again->height;
  stride_bytes_ = again->stride_bytes, size_bytes_ = again->size_bytes;
  rows_ = again->rows;
  return {};
}

Result<V4l2Capture::Agreed> V4l2Capture::try_format(Format format) {
  const uint32_t code =
      std::find_if(std::begin(kCaptureFormats), std::end(kCaptureFormats),
                   [&](const CaptureFormat& each) { return each.format == format; })
          ->code;
  v4l2_format set{};
  set.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_pix_format& pix = set.fmt.pix;
  pix.width = options_.width_px;
  pix.height = options_.height_px;
  pix.pixelformat = code;
  pix.field = V4L2_FIELD_NONE;
  pix.priv = V4L2_PIX_FMT_PRIV_MAGIC;  // matrix and range are told in return
  if (device_.control(VIDIOC_S_FMT, &set) < 0) {
    if (errno == EINVAL) return Agreed{};
    return device_.failed("takes no format");
  }
  if (pix.pixelformat != code || pix.width == 0 || pix.height == 0) return Agreed{};
  const auto senseless = [&] {
    return device_.unsupported("states a picture of " + std::to_string(pix.sizeimage) +
                               " bytes in rows of " + std::to_string(pix.bytesperline) +
                               ", which cannot hold " + video_size_text(pix.width, pix.height));
  };
  if (pix.width > kLargestSide || pix.height > kLargestSide || pix.sizeimage == 0 ||
      pix.sizeimage > kMostPictureBytes)
    return senseless();
  Agreed agreed{.format = format,
                .width = pix.width,
                .height = pix.height,
                .size_bytes = pix.sizeimage,
                .rows = rows_by(pix)};
  if (format == Format::kMjpeg) return agreed;
  const size_t least = row_bytes(format, pix.width), rows = rows_of(format, pix.height);
  agreed.stride_bytes = pix.bytesperline != 0 ? pix.bytesperline : least;
  if (agreed.stride_bytes < least || agreed.stride_bytes > kMostPictureBytes / rows)
    return senseless();
  agreed.size_bytes = agreed.stride_bytes * (rows - 1) + least;  // the last row need not be padded
  if (pix.sizeimage < agreed.size_bytes) return senseless();
  return agreed;
}

Result<bool> V4l2Capture::next(ImageU8& picture, uint64_t deadline_ns) {
  while (true) {
    std::optional<V4l2Device::Returned> newest;
    while (true) {
      const Result<V4l2Device::Returned> back = device_.take_back();
      if (!back.ok()) return back.status();
      if (back->index < 0) break;
      const bool whole = !back->broken && back->bytes > 0 &&
                         (format_ == Format::kMjpeg || back->bytes >= size_bytes_);
      if (!whole) ++broken_;
      // The one that nobody needs goes back at once.
      const std::optional<V4l2Device::Returned> other = whole ? newest : *back;
      if (whole) newest = *back;
      if (other) FIG_RETURN_IF_ERROR(device_.queue(static_cast<uint32_t>(other->index), 0));
    }
    if (newest) {
      const V4l2Device::Buffer& buffer = device_.buffers()[static_cast<size_t>(newest->index)];
      const bool shown = convert(std::min(newest->bytes, buffer.size),
                                 static_cast<const std::byte*>(buffer.memory), picture);
      FIG_RETURN_IF_ERROR(device_.queue(static_cast<uint32_t>(newest->index), 0));
      if (shown) return true;
      ++broken_;
    }
    if (device_.now_ns() >= deadline_ns) return false;
    FIG_RETURN_IF_ERROR(device_.wait(POLLIN, deadline_ns));
  }
}

bool V4l2Capture::convert(size_t bytes, const std::byte* from, ImageU8& picture) const {
  if (format_ == Format::kMjpeg) {
    Result<ImageU8> decoded = decode_jpeg({from, bytes}, device_.path());
    if (!decoded.ok()) return false;
    picture = std::move(*decoded);
    return true;
  }
  if (picture.width_px != width_ || picture.height_px != height_ || picture.channels != 3)
    picture = ImageU8(width_, height_, 3);
  const auto* const codes = reinterpret_cast<const uint8_t*>(from);
  for (uint32_t y = 0; y < height_; ++y) {
    const uint8_t* const row = codes + y * stride_bytes_;
    if (format_ == Format::kYuyv) {
      rows_.yuyv(row, width_, picture.at(0, y));
    } else {
      rows_.nv12(row, codes + (height_ + y / 2) * stride_bytes_, width_, picture.at(0, y));
    }
  }
  return true;
}

}  // namespace figurine::ports
