#include "ports/v4l2/v4l2_output.h"

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

namespace figurine::ports {

namespace {

// Three: one on the screen, one behind it, one being filled. More would be frames that wait.
constexpr uint32_t kBuffers = 3;
constexpr size_t kMostBytes = size_t{1} << 30;

struct Format {
  PixelFormat format;
  uint32_t code;       // V4L2's
  uint32_t row_bytes;  // of a pixel, of the first plane
  bool even_width, even_height;
};
constexpr Format kFormats[] = {
    {PixelFormat::kYuyv, V4L2_PIX_FMT_YUYV, 2, true, false},
    {PixelFormat::kNv12, V4L2_PIX_FMT_NV12, 1, true, true},
    {PixelFormat::kRgb24, V4L2_PIX_FMT_RGB24, 3, false, false},
    {PixelFormat::kBgr24, V4L2_PIX_FMT_BGR24, 3, false, false},
};

const Format& format_of(PixelFormat format) {
  return *std::find_if(std::begin(kFormats), std::end(kFormats),
                       [&](const Format& each) { return each.format == format; });
}

bool allows(const Format& format, uint32_t width, uint32_t height) {
  return !(format.even_width && width % 2 != 0) && !(format.even_height && height % 2 != 0);
}

}  // namespace

V4l2Output::V4l2Output(const std::string& path, const Options& options)
    : options_(options),
      device_(path, V4L2_BUF_TYPE_VIDEO_OUTPUT, options.now_ns, options.system) {}

Result<std::unique_ptr<V4l2Output>> V4l2Output::open(const std::string& path,
                                                     const Options& options) {
  std::unique_ptr<V4l2Output> output(new V4l2Output(path, options));
  V4l2Device& device = output->device_;
  FIG_RETURN_IF_ERROR(device.open("writing"));
  FIG_RETURN_IF_ERROR(output->check_device());
  FIG_RETURN_IF_ERROR(output->agree_on_format());
  FIG_RETURN_IF_ERROR(device.wish_rate(options.frames_per_second));
  FIG_RETURN_IF_ERROR(device.take_buffers(kBuffers, output->size_bytes_));
  return output;
}

Status V4l2Output::check_device() {
  const Result<uint32_t> caps = device_.capabilities();
  if (!caps.ok()) return caps.status();
  if ((*caps & V4L2_CAP_VIDEO_OUTPUT) == 0) {
    return device_.unsupported(
        (*caps & V4L2_CAP_VIDEO_OUTPUT_MPLANE) != 0
            ? "takes frames in several planes only, which figurine does not write"
            : "is no video output; a virtual camera has one before somebody else "
              "writes to it (docs/virtual_camera.md)");
  }
  if ((*caps & V4L2_CAP_STREAMING) == 0) return device_.unsupported("has no streaming of frames");
  return {};
}

Status V4l2Output::agree_on_format() {
  const std::vector<uint32_t> offered = device_.offered_formats();
  bool odd = false;
  for (const Format& format : kFormats) {
    if (options_.format && *options_.format != format.format) continue;
    if (std::find(offered.begin(), offered.end(), format.code) == offered.end()) continue;
    if (!allows(format, options_.width_px, options_.height_px)) {
      odd = true;
      continue;
    }
    bool agreed = false;
    FIG_RETURN_IF_ERROR(try_format(format.format, agreed));
    if (agreed) return {};
  }
  return device_.unsupported(odd ? "what it takes has even sizes only, and " +
                                       video_size_text(options_.width_px, options_.height_px) +
                                       " is odd"
                                 : "takes none of YUYV, NV12, RGB24 and BGR24");
}

// Sets a format; not agreed where the driver takes another one in its place. An error where it
// takes the format but no such size: the size would be the same with every format.
Status V4l2Output::try_format(PixelFormat format, bool& agreed) {
  const Format& wanted = format_of(format);
  v4l2_format set{};
  set.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  v4l2_pix_format& pix = set.fmt.pix;
  pix.width = options_.width_px;
  pix.height = options_.height_px;
  pix.pixelformat = wanted.code;
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = 0;  // the driver's choice; some keep a longer one of before otherwise
  const bool codes = format == PixelFormat::kYuyv || format == PixelFormat::kNv12;
  pix.colorspace = codes ? V4L2_COLORSPACE_SMPTE170M : V4L2_COLORSPACE_SRGB;
  pix.priv = V4L2_PIX_FMT_PRIV_MAGIC;  // the fields below are meant
  pix.ycbcr_enc = codes ? V4L2_YCBCR_ENC_601 : V4L2_YCBCR_ENC_DEFAULT;
  pix.quantization = codes ? V4L2_QUANTIZATION_LIM_RANGE : V4L2_QUANTIZATION_FULL_RANGE;
  if (device_.control(VIDIOC_S_FMT, &set) < 0) {
    if (errno == EINVAL) return {};
    return device_.failed("takes no format");
  }
  if (pix.pixelformat != wanted.code) return {};
  if (pix.width != options_.width_px || pix.height != options_.height_px) {
    return device_.unsupported(
        "takes frames of " + video_size_text(pix.width, pix.height) + ", not of " +
        video_size_text(options_.width_px, options_.height_px) + " (--size)");
  }
  const size_t least = size_t{wanted.row_bytes} * pix.width;
  const size_t stride = pix.bytesperline != 0 ? pix.bytesperline : least;
  const size_t rows = format == PixelFormat::kNv12 ? size_t{pix.height} * 3 / 2 : pix.height;
  const size_t bytes = stride * (rows - 1) + least;  // the last row need not be padded
  if (stride < least || stride > kMostBytes / rows || pix.sizeimage < bytes ||
      pix.sizeimage > kMostBytes) {
    return device_.unsupported("states a frame of " + std::to_string(pix.sizeimage) +
                               " bytes in rows of " + std::to_string(pix.bytesperline) +
                               ", which cannot hold " + video_size_text(pix.width, pix.height));
  }
  format_ = format;
  stride_bytes_ = stride;
  size_bytes_ = pix.sizeimage;
  agreed = true;
  return {};
}

Result<int> V4l2Output::free_buffer(uint64_t deadline_ns) {
  const std::vector<V4l2Device::Buffer>& buffers = device_.buffers();
  while (true) {
    const auto free = std::find_if(buffers.begin(), buffers.end(),
                                   [](const V4l2Device::Buffer& each) { return !each.queued; });
    if (free != buffers.end()) return static_cast<int>(free - buffers.begin());
    const Result<V4l2Device::Returned> back = device_.take_back();
    if (!back.ok()) return back.status();
    if (back->index >= 0) {
      if (back->broken) ++broken_;
      continue;
    }
    if (device_.now_ns() >= deadline_ns) return -1;
    FIG_RETURN_IF_ERROR(device_.wait(POLLOUT, deadline_ns));
  }
}

Result<bool> V4l2Output::show(std::span<const uint8_t> pixels, uint64_t deadline_ns) {
  const Format& format = format_of(format_);
  const size_t row = size_t{format.row_bytes} * options_.width_px,
               rows = format_ == PixelFormat::kNv12 ? size_t{options_.height_px} * 3 / 2
                                                    : options_.height_px;
  FIG_CHECK(pixels.size() == row * rows, "a frame of the device's format and size");
  const Result<int> free = free_buffer(deadline_ns);
  if (!free.ok()) return free.status();
  if (*free < 0) return false;
  const auto index = static_cast<uint32_t>(*free);
  copy(pixels, static_cast<std::byte*>(device_.buffers()[index].memory));
  FIG_RETURN_IF_ERROR(device_.queue(index, size_bytes_));
  FIG_RETURN_IF_ERROR(device_.start());
  return true;
}

// Rows at the driver's stride; the chroma of NV12 right behind the last row of luma, as the format
// of one plane has it.
void V4l2Output::copy(std::span<const uint8_t> pixels, std::byte* to) const {
  const size_t row = size_t{format_of(format_).row_bytes} * options_.width_px;
  if (row == stride_bytes_) {
    std::memcpy(to, pixels.data(), pixels.size());
    return;
  }
  for (size_t y = 0; y * row < pixels.size(); ++y)
    std::memcpy(to + y * stride_bytes_, pixels.data() + y * row, row);
}

}  // namespace figurine::ports
