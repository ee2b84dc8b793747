// The system calls that a video device is driven by, behind an interface: so that a test can be a
// device which says no wherever a real one might.
#pragma once

#include <poll.h>

#include <cstddef>

namespace figurine::ports {

// As the calls of the same names: -1 (MAP_FAILED of map) and errno where they fail. ioctl and open
// are called again after EINTR by the caller's hands in v4l2_output.cpp, not here.
class VideoSystem {
 public:
  virtual ~VideoSystem() = default;
  virtual int open(const char* path, int flags) = 0;
  virtual int close(int descriptor) = 0;
  virtual int ioctl(int descriptor, unsigned long request, void* argument) = 0;
  virtual void* map(int descriptor, size_t size, size_t offset) = 0;
  virtual int unmap(void* memory, size_t size) = 0;
  virtual int poll(pollfd& waiting, int timeout_ms) = 0;
};

// The machine's own.
VideoSystem& video_system();

}  // namespace figurine::ports
