// What an output and a capture of a video device share: the node, its system calls with what they
// say when they fail, the driver's buffers and waiting for them. Streaming I/O with buffers that
// are mapped; one queue a device.
//
// Based on: Linux Media Infrastructure userspace API, part I (Video for Linux API).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/v4l2/system.h"

namespace figurine::ports {

class V4l2Device {
 public:
  struct Buffer {
    void* memory = nullptr;
    size_t size = 0;
    bool queued = false;  // the driver has it
  };
  // type: a v4l2_buf_type, of output or of capture. clock and system: null for the machine's own.
  V4l2Device(std::string path, uint32_t type, uint64_t (*clock)(), VideoSystem* system);
  ~V4l2Device();  // ends the stream and gives everything back
  V4l2Device(const V4l2Device&) = delete;
  V4l2Device& operator=(const V4l2Device&) = delete;

  // purpose: for messages, as in "cannot be opened for writing".
  Status open(const std::string& purpose);
  // What this node can do (V4L2_CAP_*): kUnsupported for what is no video device.
  Result<uint32_t> capabilities() const;
  std::vector<uint32_t> offered_formats() const;
  // A wish: drivers without rates say ENOTTY or EINVAL, and the pace is the caller's anyway.
  Status wish_rate(double frames_per_second) const;
  // About count buffers of at least least_bytes, mapped.
  Status take_buffers(uint32_t count, size_t least_bytes);
  std::vector<Buffer>& buffers() { return buffers_; }
  size_t buffer_count() const { return buffers_.size(); }

  // Gives the driver a buffer with so many bytes in it.
  Status queue(uint32_t index, size_t bytes_used);
  Status start();  // once buffers are queued; nothing if it runs
  // A buffer that the driver is done with: its number and bytes; -1 if it has none.
  struct Returned {
    int index = -1;
    size_t bytes = 0;
    bool broken = false;
  };
  Result<Returned> take_back();
  // Waits for one until deadline_ns at most; events as of poll().
  Status wait(short events, uint64_t deadline_ns) const;
  uint64_t now_ns() const { return now_ns_(); }

  // Interrupted calls are made again. -1 and errno as ioctl().
  int control(unsigned long request, void* argument) const;
  Status failed(const std::string& what) const;  // with errno's reason
  Status unsupported(const std::string& why) const;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  uint32_t type_;
  uint64_t (*now_ns_)();
  VideoSystem& system_;
  int descriptor_ = -1;
  std::vector<Buffer> buffers_;
  bool streaming_ = false;
};

// "640x480"
std::string video_size_text(uint32_t width, uint32_t height);

}  // namespace figurine::ports
