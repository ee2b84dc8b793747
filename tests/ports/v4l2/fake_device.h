// A video device in memory that does what a test tells it to: its formats, its stride, its buffers,
// and an error at any call.
#pragma once

#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ports/v4l2/system.h"

namespace figurine::tests {

class FakeDevice final : public ports::VideoSystem {
 public:
  // What it is.
  uint32_t capabilities = V4L2_CAP_DEVICE_CAPS,
           device_caps = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  std::vector<uint32_t> formats = {V4L2_PIX_FMT_YUYV};
  uint32_t stride_padding = 0;     // bytes behind every row
  uint32_t only_width = 0;         // 0: any
  uint32_t insists_on_format = 0;  // 0: takes what is asked for
  uint32_t sizeimage_off = 0;      // taken off what a frame needs
  uint32_t buffer_count = 0;       // 0: what is asked for
  uint32_t buffer_bytes_off = 0;
  uint32_t wrong_index = 0;  // added to a buffer's number when it is given back
  uint32_t flags = 0;        // of buffers that are given back
  bool shows = true;         // gives buffers back at once

  // A camera, in place of an output: what it gives, a buffer each, in order.
  struct Given {
    std::vector<uint8_t> bytes;
    uint32_t buffer_flags = 0;
  };
  void become_camera() { device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING; }
  std::deque<Given> given;
  std::map<uint32_t, uint32_t> largest_width;        // by format; others: any
  uint32_t colorspace = 0, encoding = 0, range = 0;  // that it states

  // Error number at the nth next call (0: this one) of open, map, poll or a request; later calls
  // too if forever.
  void fail(unsigned long request, int error, int nth = 0, bool forever = false) {
    failures_[request] = {error, nth, forever};
  }
  static constexpr unsigned long kOpen = 1, kMap = 2, kPoll = 3;
  void interrupt_everything() { interrupts_ = true; }  // EINTR before each call succeeds

  // What happened.
  v4l2_pix_format agreed{};
  v4l2_fract interval{};
  std::vector<std::vector<uint8_t>> shown;  // frames, whole buffers as they were queued
  std::vector<uint32_t> bytes_used;
  int streams_on = 0, streams_off = 0, opened = 0, closed = 0, mapped = 0, unmapped = 0;

  int open(const char* path, int) override {
    path_ = path;
    if (fails(kOpen)) return -1;
    ++opened;
    return 40;
  }
  int close(int) override { return ++closed, 0; }
  void* map(int, size_t size, size_t offset) override {
    if (fails(kMap)) return MAP_FAILED;
    ++mapped;
    std::vector<uint8_t>& memory = buffers_.at(offset / kOffset);
    if (size > memory.size()) return MAP_FAILED;
    return memory.data();
  }
  int unmap(void*, size_t) override { return ++unmapped, 0; }
  int poll(pollfd& waiting, int) override {
    if (fails(kPoll)) return -1;
    const bool ready = is_camera() ? !given.empty() : !queue_.empty();
    waiting.revents = ready ? waiting.events : 0;
    ++polls;
    return ready ? 1 : 0;
  }
  int polls = 0;

  int ioctl(int, unsigned long request, void* argument) override {
    if (interrupts_ && !interrupted_[request]) {
      interrupted_[request] = true;
      return errno = EINTR, -1;
    }
    interrupted_[request] = false;
    if (fails(request)) return -1;
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& able = *static_cast<v4l2_capability*>(argument);
        able.capabilities = capabilities, able.device_caps = device_caps;
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto& each = *static_cast<v4l2_fmtdesc*>(argument);
        if (each.index >= formats.size()) return errno = EINVAL, -1;
        each.pixelformat = formats[each.index];
        return 0;
      }
      case VIDIOC_S_FMT:
        return set_format(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_S_PARM:
        interval = static_cast<v4l2_streamparm*>(argument)->parm.output.timeperframe;
        return 0;
      case VIDIOC_REQBUFS: {
        auto& wanted = *static_cast<v4l2_requestbuffers*>(argument);
        if (buffer_count != 0) wanted.count = buffer_count == UINT32_MAX ? 0 : buffer_count;
        if (wanted.count < 100)
          buffers_.assign(wanted.count, std::vector<uint8_t>(agreed.sizeimage, 0xEE));
        return 0;
      }
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = agreed.sizeimage - buffer_bytes_off;
        buffer.m.offset = static_cast<uint32_t>(buffer.index * kOffset);
        return 0;
      }
      case VIDIOC_QBUF: {
        const auto& buffer = *static_cast<v4l2_buffer*>(argument);
        queue_.push_back(buffer.index);
        shown.push_back(buffers_.at(buffer.index));
        bytes_used.push_back(buffer.bytesused);
        return 0;
      }
      case VIDIOC_DQBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        if (queue_.empty() || !shows) return errno = EAGAIN, -1;
        if (is_camera()) {
          if (given.empty()) return errno = EAGAIN, -1;
          std::vector<uint8_t>& memory = buffers_.at(queue_.front());
          const Given& next = given.front();
          std::copy_n(next.bytes.begin(), std::min(next.bytes.size(), memory.size()),
                      memory.begin());
          buffer.bytesused = static_cast<uint32_t>(next.bytes.size());
          buffer.flags = next.buffer_flags;
          given.pop_front();
        } else {
          buffer.flags = flags;
        }
        buffer.index = queue_.front() + wrong_index;
        queue_.pop_front();
        return 0;
      }
      case VIDIOC_STREAMON:
        return ++streams_on, 0;
      case VIDIOC_STREAMOFF:
        return ++streams_off, 0;
      default:
        return errno = ENOTTY, -1;
    }
  }

 private:
  static constexpr size_t kOffset = 1 << 20;
  struct Failure {
    int error = 0, nth = 0;
    bool forever = false;
  };

  bool fails(unsigned long request) {
    const auto at = failures_.find(request);
    if (at == failures_.end() || at->second.nth-- > 0) return false;
    errno = at->second.error;
    if (at->second.forever) {
      at->second.nth = 0;
    } else {
      failures_.erase(at);
    }
    return true;
  }

  bool is_camera() const { return (device_caps & V4L2_CAP_VIDEO_CAPTURE) != 0; }

  int set_format(v4l2_pix_format& pix) {
    if (only_width != 0) pix.width = only_width;
    if (const auto most = largest_width.find(pix.pixelformat); most != largest_width.end())
      pix.width = std::min(pix.width, most->second);
    if (is_camera())
      pix.colorspace = colorspace, pix.ycbcr_enc = encoding, pix.quantization = range;
    if (insists_on_format != 0) pix.pixelformat = insists_on_format;
    if (pix.pixelformat == V4L2_PIX_FMT_MJPEG && is_camera()) {
      pix.bytesperline = 0;
      pix.sizeimage = 100000 - sizeimage_off;
      agreed = pix;
      return 0;
    }
    const bool nv12 = pix.pixelformat == V4L2_PIX_FMT_NV12;
    const uint32_t bytes = nv12 ? 1 : pix.pixelformat == V4L2_PIX_FMT_YUYV ? 2 : 3;
    pix.bytesperline = pix.width * bytes + stride_padding;
    pix.sizeimage = pix.bytesperline * (nv12 ? pix.height * 3 / 2 : pix.height) - sizeimage_off;
    agreed = pix;
    return 0;
  }

  std::string path_;
  std::map<unsigned long, Failure> failures_;
  std::map<unsigned long, bool> interrupted_;
  bool interrupts_ = false;
  std::vector<std::vector<uint8_t>> buffers_;
  std::deque<uint32_t> queue_;
};

}  // namespace figurine::tests
