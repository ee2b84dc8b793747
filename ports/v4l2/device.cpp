#include "ports/v4l2/device.h"

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

constexpr uint32_t kMostBuffers = 32;

}  // namespace

V4l2Device::V4l2Device(std::string path, uint32_t type, uint64_t (*clock)(), VideoSystem* system)
    : path_(std::move(path)),
      type_(type),
      now_ns_(clock != nullptr ? clock : ports::now_ns),
      system_(system != nullptr ? *system : video_system()) {}

V4l2Device::~V4l2Device() {
  if (streaming_) control(VIDIOC_STREAMOFF, &type_);
  for (const Buffer& buffer : buffers_) {
    if (buffer.memory != nullptr) system_.unmap(buffer.memory, buffer.size);
  }
  if (descriptor_ >= 0) system_.close(descriptor_);
}

Status V4l2Device::failed(const std::string& what) const {
  const int code = errno;
  if (code == ENODEV) return Status(StatusCode::kIo, path_ + ": the device is gone");
  if (code == EBUSY)
    return Status(StatusCode::kIo, path_ + ": " + what + ": in use by another program");
  return Status(StatusCode::kIo, path_ + ": " + what + ": " + std::strerror(code));
}

Status V4l2Device::unsupported(const std::string& why) const {
  return Status(StatusCode::kUnsupported, path_ + ": " + why);
}

int V4l2Device::control(unsigned long request, void* argument) const {
  int result = 0;
  do {
    result = system_.ioctl(descriptor_, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

// Without waiting: what is not ready is asked for with poll().
Status V4l2Device::open(const std::string& purpose) {
  do {
    descriptor_ = system_.open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  } while (descriptor_ < 0 && errno == EINTR);
  return descriptor_ < 0 ? failed("cannot be opened for " + purpose) : Status();
}

Result<uint32_t> V4l2Device::capabilities() const {
  v4l2_capability able{};
  if (control(VIDIOC_QUERYCAP, &able) < 0) {
    return errno == ENOTTY || errno == EINVAL ? unsupported("is no video device")
                                              : failed("cannot be asked what it is");
  }
  // Of this node where the driver tells, else of all of the device's nodes.
  return able.capabilities & V4L2_CAP_DEVICE_CAPS ? able.device_caps : able.capabilities;
}

std::vector<uint32_t> V4l2Device::offered_formats() const {
  std::vector<uint32_t> offered;
  v4l2_fmtdesc each{};
  each.type = type_;
  for (; each.index < 1000 && control(VIDIOC_ENUM_FMT, &each) == 0; ++each.index)
    offered.push_back(each.pixelformat);
  return offered;
}

Status V4l2Device::wish_rate(double frames_per_second) const {
  v4l2_streamparm parameters{};
  parameters.type = type_;
  const v4l2_fract interval{1000, static_cast<uint32_t>(std::lround(frames_per_second * 1000))};
  if (type_ == V4L2_BUF_TYPE_VIDEO_OUTPUT) {
    parameters.parm.output.timeperframe = interval;
  } else {
    parameters.parm.capture.timeperframe = interval;
  }
  if (control(VIDIOC_S_PARM, &parameters) < 0 && errno == ENODEV) return failed("");
  return {};
}

Status V4l2Device::take_buffers(uint32_t count, size_t least_bytes) {
  v4l2_requestbuffers request{};
  request.type = type_;
  request.memory = V4L2_MEMORY_MMAP;
  request.count = count;
  if (control(VIDIOC_REQBUFS, &request) < 0) return failed("gives no buffers");
  if (request.count == 0 || request.count > kMostBuffers)
    return Status(StatusCode::kIo, path_ + ": gives " + std::to_string(request.count) + " buffers");
  for (uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.type = type_;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = i;
    if (control(VIDIOC_QUERYBUF, &buffer) < 0) return failed("says nothing of a buffer");
    if (buffer.length < least_bytes) {
      return Status(StatusCode::kIo, path_ + ": gives a buffer of " +
                                         std::to_string(buffer.length) + " bytes for frames of " +
                                         std::to_string(least_bytes));
    }
    void* memory = system_.map(descriptor_, buffer.length, buffer.m.offset);
    if (memory == MAP_FAILED) return failed("a buffer cannot be mapped");
    buffers_.push_back({memory, buffer.length, false});
  }
  return {};
}

Status V4l2Device::queue(uint32_t index, size_t bytes_used) {
  v4l2_buffer queued{};
  queued.type = type_;
  queued.memory = V4L2_MEMORY_MMAP;
  queued.index = index;
  queued.bytesused = static_cast<uint32_t>(bytes_used);
  queued.field = V4L2_FIELD_NONE;
  if (control(VIDIOC_QBUF, &queued) < 0) return failed("takes no frame");
  buffers_[index].queued = true;
  return {};
}

Status V4l2Device::start() {
  if (streaming_) return {};
  if (control(VIDIOC_STREAMON, &type_) < 0) return failed("does not start");
  streaming_ = true;
  return {};
}

Result<V4l2Device::Returned> V4l2Device::take_back() {
  v4l2_buffer back{};
  back.type = type_;
  back.memory = V4L2_MEMORY_MMAP;
  if (control(VIDIOC_DQBUF, &back) < 0)
    return errno == EAGAIN ? Result(Returned{}) : failed("gave no buffer back");
  if (back.index >= buffers_.size())
    return Status(StatusCode::kIo, path_ + ": gave back a buffer that there is none of");
  buffers_[back.index].queued = false;
  return Returned{static_cast<int>(back.index), back.bytesused,
                  (back.flags & V4L2_BUF_FLAG_ERROR) != 0};
}

Status V4l2Device::wait(short events, uint64_t deadline_ns) const {
  const uint64_t now = now_ns_();
  if (now >= deadline_ns) return {};
  const uint64_t left_ms = (deadline_ns - now + 999'999) / 1'000'000;
  pollfd waiting{.fd = descriptor_, .events = events, .revents = 0};
  if (system_.poll(waiting, static_cast<int>(std::min<uint64_t>(left_ms, INT_MAX))) < 0 &&
      errno != EINTR)
    return failed("cannot be waited for");
  return {};
}

std::string video_size_text(uint32_t width, uint32_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

}  // namespace figurine::ports
