#include "ports/v4l2/system.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace figurine::ports {

namespace {

class LinuxVideo final : public VideoSystem {
 public:
  int open(const char* path, int flags) override { return ::open(path, flags); }
  int close(int descriptor) override { return ::close(descriptor); }
  int ioctl(int descriptor, unsigned long request, void* argument) override {
    return ::ioctl(descriptor, request, argument);
  }
  void* map(int descriptor, size_t size, size_t offset) override {
    return ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor,
                  static_cast<off_t>(offset));
  }
  int unmap(void* memory, size_t size) override { return ::munmap(memory, size); }
  int poll(pollfd& waiting, int timeout_ms) override { return ::poll(&waiting, 1, timeout_ms); }
};

}  // namespace

VideoSystem& video_system() {
  static LinuxVideo system;
  return system;
}

}  // namespace figurine::ports
