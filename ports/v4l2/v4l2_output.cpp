#include "ports/v4l2/v4l2_output.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cmath>
#include <cstring>

#include "ports/host/clock.h"

namespace figurine::ports {

namespace {

// Three: one on the screen, one behind it, one being filled. More would be frames that wait.
constexpr uint32_t kBuffers = 3;
constexpr uint32_t kMostBuffers = 32;
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

std::string size_text(uint32_t width, uint32_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

}  // namespace

V4l2Output::V4l2Output(std::string path, const Options& options)
    : path_(std::move(path)),
      options_(options),
      system_(options.system != nullptr ? *options.system : video_system()) {
  if (options_.now_ns == nullptr) options_.now_ns = ports::now_ns;
}

V4l2Output::~V4l2Output() {
  v4l2_buf_type type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  if (streaming_) control(VIDIOC_STREAMOFF, &type);
  for (const Buffer& buffer : buffers_) {
    if (buffer.memory != nullptr) system_.unmap(buffer.memory, buffer.size);
  }
  if (descriptor_ >= 0) system_.close(descriptor_);
}

Status V4l2Output::failed(const std::string& what) const {
  const int code = errno;
  if (code == ENODEV) return Status(StatusCode::kIo, path_ + ": the device is gone");
  if (code == EBUSY)
    return Status(StatusCode::kIo, path_ + ": " + what + ": in use by another program");
  return Status(StatusCode::kIo, path_ + ": " + what + ": " + std::strerror(code));
}

int V4l2Output::control(unsigned long request, void* argument) const {
  int result = 0;
  do {
    result = system_.ioctl(descriptor_, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

Result<std::unique_ptr<V4l2Output>> V4l2Output::open(const std::string& path,
                                                     const Options& options) {
  std::unique_ptr<V4l2Output> output(new V4l2Output(path, options));
  // Without waiting: what is not ready is asked for with poll().
  do {
    output->descriptor_ = output->system_.open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  } while (output->descriptor_ < 0 && errno == EINTR);
  if (output->descriptor_ < 0) return output->failed("cannot be opened for writing");
  FIG_RETURN_IF_ERROR(output->check_device());
  FIG_RETURN_IF_ERROR(output->agree_on_format());
  FIG_RETURN_IF_ERROR(output->agree_on_rate());
  FIG_RETURN_IF_ERROR(output->take_buffers());
  return output;
}

Status V4l2Output::check_device() {
  const auto unsupported = [&](const std::string& why) {
    return Status(StatusCode::kUnsupported, path_ + ": " + why);
  };
  v4l2_capability able{};
  if (control(VIDIOC_QUERYCAP, &able) < 0) {
    return errno == ENOTTY || errno == EINVAL ? unsupported("is no video device")
                                              : failed("cannot be asked what it is");
  }
  // Of this node where the driver tells, else of all of the device's nodes.
  const uint32_t caps =
      able.capabilities & V4L2_CAP_DEVICE_CAPS ? able.device_caps : able.capabilities;
  if ((caps & V4L2_CAP_VIDEO_OUTPUT) == 0) {
    return unsupported((caps & V4L2_CAP_VIDEO_OUTPUT_MPLANE) != 0
                           ? "takes frames in several planes only, which figurine does not write"
                           : "is no video output; a virtual camera has one before somebody else "
                             "writes to it (docs/virtual_camera.md)");
  }
  if ((caps & V4L2_CAP_STREAMING) == 0) return unsupported("has no streaming of frames");
  return {};
}

Status V4l2Output::agree_on_format() {
  std::vector<uint32_t> offered;
  v4l2_fmtdesc each{};
  each.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  for (; each.index < 1000 && control(VIDIOC_ENUM_FMT, &each) == 0; ++each.index)
    offered.push_back(each.pixelformat);
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
  return Status(StatusCode::kUnsupported,
                path_ + (odd ? ": what it takes has even sizes only, and " +
                                   size_text(options_.width_px, options_.height_px) + " is odd"
                             : ": takes none of YUYV, NV12, RGB24 and BGR24"));
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
  if (control(VIDIOC_S_FMT, &set) < 0) {
    if (errno == EINVAL) return {};
    return failed("takes no format");
  }
  if (pix.pixelformat != wanted.code) return {};
  if (pix.width != options_.width_px || pix.height != options_.height_px) {
    return Status(StatusCode::kUnsupported,
                  path_ + ": takes frames of " + size_text(pix.width, pix.height) + ", not of " +
                      size_text(options_.width_px, options_.height_px) + " (--size)");
  }
  const size_t least = size_t{wanted.row_bytes} * pix.width;
  const size_t stride = pix.bytesperline != 0 ? pix.bytesperline : least;
  const size_t rows = format == PixelFormat::kNv12 ? size_t{pix.height} * 3 / 2 : pix.height;
  const size_t bytes = stride * (rows - 1) + least;  // the last row need not be padded
  if (stride < least || stride > kMostBytes / rows || pix.sizeimage < bytes ||
      pix.sizeimage > kMostBytes) {
    return Status(StatusCode::kUnsupported,
                  path_ + ": states a frame of " + std::to_string(pix.sizeimage) +
                      " bytes in rows of " + std::to_string(pix.bytesperline) +
                      ", which cannot hold " + size_text(pix.width, pix.height));
  }
  format_ = format;
  stride_bytes_ = stride;
  size_bytes_ = pix.sizeimage;
  agreed = true;
  return {};
}

// A wish: drivers without rates say ENOTTY or EINVAL, and the pace is the caller's anyway.
Status V4l2Output::agree_on_rate() {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  parameters.parm.output.timeperframe = {
      1000, static_cast<uint32_t>(std::lround(options_.frames_per_second * 1000))};
  if (control(VIDIOC_S_PARM, &parameters) < 0 && errno == ENODEV) return failed("");
  return {};
}

Status V4l2Output::take_buffers() {
  v4l2_requestbuffers request{};
  request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  request.memory = V4L2_MEMORY_MMAP;
  request.count = kBuffers;
  if (control(VIDIOC_REQBUFS, &request) < 0) return failed("gives no buffers");
  if (request.count == 0 || request.count > kMostBuffers)
    return Status(StatusCode::kIo, path_ + ": gives " + std::to_string(request.count) + " buffers");
  for (uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = i;
    if (control(VIDIOC_QUERYBUF, &buffer) < 0) return failed("says nothing of a buffer");
    if (buffer.length < size_bytes_) {
      return Status(StatusCode::kIo, path_ + ": gives a buffer of " +
                                         std::to_string(buffer.length) + " bytes for frames of " +
                                         std::to_string(size_bytes_));
    }
    void* memory = system_.map(descriptor_, buffer.length, buffer.m.offset);
    if (memory == MAP_FAILED) return failed("a buffer cannot be mapped");
    buffers_.push_back({memory, buffer.length, false});
  }
  return {};
}

Result<int> V4l2Output::free_buffer(uint64_t deadline_ns) {
  const auto free_one = [&] {
    const auto at = std::find_if(buffers_.begin(), buffers_.end(),
                                 [](const Buffer& buffer) { return !buffer.queued; });
    return at == buffers_.end() ? -1 : static_cast<int>(at - buffers_.begin());
  };
  while (true) {
    if (const int free = free_one(); free >= 0) return free;
    v4l2_buffer back{};
    back.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    back.memory = V4L2_MEMORY_MMAP;
    if (control(VIDIOC_DQBUF, &back) == 0) {
      if (back.index >= buffers_.size())
        return Status(StatusCode::kIo, path_ + ": gave back a buffer that there is none of");
      buffers_[back.index].queued = false;
      if ((back.flags & V4L2_BUF_FLAG_ERROR) != 0) ++broken_;
      continue;
    }
    if (errno != EAGAIN) return failed("gave no buffer back");
    const uint64_t now = options_.now_ns();
    if (now >= deadline_ns) return -1;
    const uint64_t left_ms = (deadline_ns - now + 999'999) / 1'000'000;
    pollfd waiting{.fd = descriptor_, .events = POLLOUT, .revents = 0};
    if (system_.poll(waiting, static_cast<int>(std::min<uint64_t>(left_ms, INT_MAX))) < 0 &&
        errno != EINTR)
      return failed("cannot be waited for");
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
  Buffer& buffer = buffers_[static_cast<size_t>(*free)];
  copy(pixels, static_cast<std::byte*>(buffer.memory));
  v4l2_buffer queued{};
  queued.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  queued.memory = V4L2_MEMORY_MMAP;
  queued.index = static_cast<uint32_t>(*free);
  queued.bytesused = static_cast<uint32_t>(size_bytes_);
  queued.field = V4L2_FIELD_NONE;
  if (control(VIDIOC_QBUF, &queued) < 0) return failed("takes no frame");
  buffer.queued = true;
  if (!streaming_) {
    v4l2_buf_type type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    if (control(VIDIOC_STREAMON, &type) < 0) return failed("does not start");
    streaming_ = true;
  }
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
