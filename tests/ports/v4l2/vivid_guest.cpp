// The whole user space of a virtual machine that tries ports/v4l2 on a real kernel driver: the
// first process, linked statically, in an initramfs of itself and the modules of `vivid`, the
// kernel's virtual video device. Loads them, sends frames of every format and size out and reads
// them back through vivid's loop from output to input, by itself and through the port, lets vivid
// fail in every way that it can, prints a line a check and "RESULT passed P failed F", and switches
// the machine off. vivid_test.py is the outside of it.
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "ports/host/clock.h"
#include "ports/v4l2/v4l2_capture.h"
#include "ports/v4l2/v4l2_output.h"

namespace figurine::tests {
namespace {

constexpr uint64_t kSecond_ns = 1'000'000'000;
constexpr const char* kVivid =
    "n_devs=1 node_types=0x101 num_inputs=1 input_types=0x3 num_outputs=1 output_types=0x1";

int passed = 0, failed = 0;

void check(bool holds, const std::string& what) {
  std::printf("%s %s\n", holds ? "ok  " : "FAIL", what.c_str());
  std::fflush(stdout);
  ++(holds ? passed : failed);
}

void check_says(const Status& status, const std::string& wanted) {
  const bool holds = status.message().find(wanted) != std::string::npos;
  check(holds, wanted + (holds ? "" : " <- " + status.message()));
}

int control(int descriptor, unsigned long request, void* argument) {
  int result = 0;
  do {
    result = ::ioctl(descriptor, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

bool load_modules() {
  ::mount("dev", "/dev", "devtmpfs", 0, nullptr);
  std::ifstream order("/modules/order");
  bool loaded = true;
  for (std::string name; std::getline(order, name);) {
    const int file = ::open(("/modules/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    const bool vivid = name.starts_with("vivid");
    if (::syscall(SYS_finit_module, file, vivid ? kVivid : "", 0) != 0 && errno != EEXIST) {
      std::printf("%s: %s\n", name.c_str(), std::strerror(errno));
      loaded = false;
    }
    ::close(file);
  }
  return loaded;
}

// The first node whose device can do this.
std::string find_node(uint32_t capability) {
  for (int i = 0; i < 16; ++i) {
    const std::string path = "/dev/video" + std::to_string(i);
    const int node = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (node < 0) continue;
    v4l2_capability able{};
    const bool found =
        control(node, VIDIOC_QUERYCAP, &able) == 0 && (able.device_caps & capability) != 0;
    ::close(node);
    if (found) return path;
  }
  return "";
}

// A node that is kept open for what V4l2Output does not do: timings and controls.
class Node {
 public:
  explicit Node(const std::string& path)
      : descriptor_(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {}
  ~Node() { ::close(descriptor_); }
  int descriptor() const { return descriptor_; }

  bool set(const char* name, int value) const {
    v4l2_query_ext_ctrl each{};
    each.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (control(descriptor_, VIDIOC_QUERY_EXT_CTRL, &each) == 0) {
      if (std::strcmp(each.name, name) == 0) {
        v4l2_control set{each.id, value};
        return control(descriptor_, VIDIOC_S_CTRL, &set) == 0;
      }
      each.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return false;
  }

  // Of a menu whose name ends so: its last entry.
  bool set_last(const char* ending) const {
    v4l2_query_ext_ctrl each{};
    each.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (control(descriptor_, VIDIOC_QUERY_EXT_CTRL, &each) == 0) {
      if (std::string_view(each.name).ends_with(ending)) {
        v4l2_control set{each.id, static_cast<int32_t>(each.maximum)};
        return control(descriptor_, VIDIOC_S_CTRL, &set) == 0;
      }
      each.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return false;
  }

  // Timings of 60 pictures a second of this size, which an HDMI line has to have first.
  bool set_timings(uint32_t width, uint32_t height) const {
    v4l2_enum_dv_timings each{};
    for (; control(descriptor_, VIDIOC_ENUM_DV_TIMINGS, &each) == 0; ++each.index) {
      const v4l2_bt_timings& bt = each.timings.bt;
      const uint64_t per_second =
          uint64_t{60} * V4L2_DV_BT_FRAME_WIDTH(&bt) * V4L2_DV_BT_FRAME_HEIGHT(&bt);
      if (bt.width != width || bt.height != height || bt.interlaced != 0 ||
          bt.pixelclock > per_second * 101 / 100 || bt.pixelclock < per_second * 99 / 100)
        continue;
      return control(descriptor_, VIDIOC_S_DV_TIMINGS, &each.timings) == 0;
    }
    return false;
  }

 private:
  int descriptor_;
};

// Reads frames of a format from the capture node.
class Capture {
 public:
  Capture(const Node& node, uint32_t width, uint32_t height, uint32_t code) : node_(node) {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = width, format.fmt.pix.height = height;
    format.fmt.pix.pixelformat = code, format.fmt.pix.field = V4L2_FIELD_NONE;
    sound_ = control(node.descriptor(), VIDIOC_S_FMT, &format) == 0 &&
             format.fmt.pix.width == width && format.fmt.pix.height == height &&
             format.fmt.pix.pixelformat == code;
    stride_ = format.fmt.pix.bytesperline;
    v4l2_requestbuffers request{};
    request.count = 3, request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    sound_ = sound_ && control(node.descriptor(), VIDIOC_REQBUFS, &request) == 0;
    for (uint32_t i = 0; sound_ && i < request.count; ++i) {
      v4l2_buffer buffer = described(i);
      sound_ = control(node.descriptor(), VIDIOC_QUERYBUF, &buffer) == 0;
      void* memory =
          ::mmap(nullptr, buffer.length, PROT_READ, MAP_SHARED, node.descriptor(), buffer.m.offset);
      sound_ = sound_ && memory != MAP_FAILED;
      if (!sound_) break;
      buffers_.push_back({memory, buffer.length});
      control(node.descriptor(), VIDIOC_QBUF, &buffer);
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    sound_ = sound_ && control(node.descriptor(), VIDIOC_STREAMON, &type) == 0;
  }
  ~Capture() {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    control(node_.descriptor(), VIDIOC_STREAMOFF, &type);
    for (const auto& [memory, size] : buffers_) ::munmap(memory, size);
    v4l2_requestbuffers none{};
    none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE, none.memory = V4L2_MEMORY_MMAP;
    control(node_.descriptor(), VIDIOC_REQBUFS, &none);
  }
  bool sound() const { return sound_; }

  // The next frame's rows without padding; empty if none comes within three seconds.
  std::vector<uint8_t> next(size_t row_bytes, size_t rows) {
    pollfd waiting{.fd = node_.descriptor(), .events = POLLIN, .revents = 0};
    v4l2_buffer buffer = described(0);
    std::vector<uint8_t> pixels;
    if (::poll(&waiting, 1, 3000) <= 0 || control(node_.descriptor(), VIDIOC_DQBUF, &buffer) != 0)
      return pixels;
    const auto* bytes = static_cast<const uint8_t*>(buffers_[buffer.index].first);
    for (size_t y = 0; y < rows; ++y)
      pixels.insert(pixels.end(), bytes + y * stride_, bytes + y * stride_ + row_bytes);
    control(node_.descriptor(), VIDIOC_QBUF, &buffer);
    return pixels;
  }

 private:
  static v4l2_buffer described(uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE, buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
  }
  const Node& node_;
  bool sound_ = false;
  size_t stride_ = 0;
  std::vector<std::pair<void*, size_t>> buffers_;
};

struct Format {
  const char* name;
  PixelFormat format;
  uint32_t code;
  uint32_t row_bytes;  // of a pixel
  bool half_more;      // rows: chroma below
};
constexpr Format kFormats[] = {{"YUYV", PixelFormat::kYuyv, V4L2_PIX_FMT_YUYV, 2, false},
                               {"NV12", PixelFormat::kNv12, V4L2_PIX_FMT_NV12, 1, true},
                               {"RGB24", PixelFormat::kRgb24, V4L2_PIX_FMT_RGB24, 3, false},
                               {"BGR24", PixelFormat::kBgr24, V4L2_PIX_FMT_BGR24, 3, false}};

// Codes that no two pixels near each other share, within limited range.
std::vector<uint8_t> pattern(size_t row, size_t rows, uint32_t seed) {
  std::vector<uint8_t> pixels(row * rows);
  for (size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<uint8_t>(16 + (i * 7 + (i / row) * 3 + seed * 11) % 220);
  return pixels;
}

Result<std::unique_ptr<ports::V4l2Output>> open_output(const std::string& path, uint32_t width,
                                                       uint32_t height,
                                                       std::optional<PixelFormat> format = {}) {
  return ports::V4l2Output::open(
      path, {.width_px = width, .height_px = height, .frames_per_second = 60, .format = format});
}

void frames_come_back(const std::string& output, const Node& out, const Node& in) {
  for (const auto& [width, height] : {std::pair(640u, 480u), std::pair(1280u, 720u)}) {
    const std::string size = std::to_string(width) + "x" + std::to_string(height);
    check(out.set_timings(width, height) && in.set_timings(width, height), "timings of " + size);
    for (const Format& format : kFormats) {
      const size_t row = size_t{format.row_bytes} * width,
                   rows = format.half_more ? size_t{height} * 3 / 2 : height;
      auto sink = open_output(output, width, height, format.format);
      if (!sink.ok()) {
        check(false, sink.status().message());
        continue;
      }
      Capture capture(in, width, height, format.code);
      const std::vector<uint8_t> pixels = pattern(row, rows, height);
      int same = 0, read = 0;
      for (int i = 0; i < 40 && same < 2 && capture.sound(); ++i) {
        const Result<bool> shown = (*sink)->show(pixels, ports::now_ns() + 2 * kSecond_ns);
        if (!shown.ok() || !*shown) break;
        const std::vector<uint8_t> got = capture.next(row, rows);
        read += !got.empty();
        same += got == pixels;
      }
      check(same >= 2, std::string("frames of ") + format.name + " " + size +
                           " come back to the bit (" + std::to_string(same) + " of " +
                           std::to_string(read) + ", stride " +
                           std::to_string((*sink)->stride_bytes()) + ")");
    }
  }
}

// vivid's thread of the output and that of the input each take this wish and clear it after every
// picture, so one may be lost or go to the other: wished again until it shows.
template <class Seen>
bool until_broken(const Node& node, Seen seen) {
  for (int i = 0; i < 30; ++i) {
    if (!node.set("Inject V4L2_BUF_FLAG_ERROR", 1)) return false;
    if (seen()) return true;
  }
  return false;
}

// What goes out as YUYV comes in as a picture, in the colours that both sides agree on.
void pictures_come_in(const std::string& output, const std::string& input, const Node& out,
                      const Node& in) {
  constexpr uint32_t kWidth = 640, kHeight = 480;
  check(out.set_timings(kWidth, kHeight) && in.set_timings(kWidth, kHeight), "timings of a camera");
  auto sink = open_output(output, kWidth, kHeight, PixelFormat::kYuyv);
  auto camera = ports::V4l2Capture::open(input, {.width_px = kWidth, .height_px = kHeight});
  check(sink.ok() && camera.ok(), "a camera opens " + camera.status().message());
  if (!sink.ok() || !camera.ok()) return;
  check((*camera)->width_px() == kWidth && (*camera)->height_px() == kHeight, "of that size");
  check_says(ports::V4l2Capture::open(input, {}).status(), "in use by another program");
  const std::vector<uint8_t> pixels = pattern(size_t{2} * kWidth, kHeight, 5);
  const ports::YcbcrRows rows(YcbcrMatrix::kBt601, false);
  ports::ImageU8 wanted(kWidth, kHeight, 3), picture;
  for (uint32_t y = 0; y < kHeight; ++y)
    rows.yuyv(&pixels[size_t{2} * kWidth * y], kWidth, wanted.at(0, y));
  int same = 0, read = 0;
  for (int i = 0; i < 40 && same < 2; ++i) {
    const Result<bool> shown = (*sink)->show(pixels, ports::now_ns() + 2 * kSecond_ns);
    if (!shown.ok() || !*shown) break;
    const Result<bool> came = (*camera)->next(picture, ports::now_ns() + 2 * kSecond_ns);
    if (!came.ok()) break;
    read += *came;
    same += *came && picture.pixels == wanted.pixels;
  }
  check(same >= 2, "pictures come in to the bit (" + std::to_string(same) + " of " +
                       std::to_string(read) + ")");
  bool sound = true;
  const bool counted = until_broken(in, [&] {
    sound = sound && (*camera)->next(picture, ports::now_ns() + kSecond_ns).ok();
    return (*camera)->broken_pictures() > 0;
  });
  check(sound && counted, "a broken picture is counted and no error");
  check(in.set("Inject Fatal Streaming Error", 1), "control: the camera fails");
  Result<bool> came = true;
  for (int i = 0; i < 30 && came.ok(); ++i)
    came = (*camera)->next(picture, ports::now_ns() + kSecond_ns);
  check_says(came.status(), "Input/output error");
}

// Frames until the device says no, a second's worth at most.
Status show_until_refused(ports::V4l2Output& sink, std::span<const uint8_t> pixels) {
  for (int i = 0; i < 60; ++i) {
    const Result<bool> shown = sink.show(pixels, ports::now_ns() + kSecond_ns);
    if (!shown.ok()) return shown.status();
  }
  return {};
}

bool shows(ports::V4l2Output& sink, std::span<const uint8_t> pixels) {
  const Result<bool> shown = sink.show(pixels, ports::now_ns() + kSecond_ns);
  return shown.ok() && *shown;
}

void it_says_why(const std::string& output, const std::string& input, const Node& out) {
  constexpr uint32_t kWidth = 640, kHeight = 480;
  const std::vector<uint8_t> pixels = pattern(kWidth * 2, kHeight, 1);
  check(out.set_timings(kWidth, kHeight), "timings for the errors");
  check_says(open_output(input, kWidth, kHeight).status(), "is no video output");
  check_says(open_output("/dev/null", kWidth, kHeight).status(), "is no video device");
  check_says(open_output("/dev/video99", kWidth, kHeight).status(), "No such file or directory");
  check_says(open_output(output, 641, kHeight, PixelFormat::kYuyv).status(), "even sizes only");
  {
    auto first = open_output(output, kWidth, kHeight);
    check(first.ok() && shows(**first, pixels), "one writer");
    check_says(open_output(output, kWidth, kHeight).status(), "in use by another program");
  }
  {
    auto sink = open_output(output, kWidth, kHeight);
    check(sink.ok() && out.set("Inject VIDIOC_STREAMON Error", 1), "control: no start");
    if (sink.ok()) check_says(show_until_refused(**sink, pixels), "Invalid argument");
  }
  check(out.set("Inject VIDIOC_REQBUFS Error", 1), "control: no buffers");
  check_says(open_output(output, kWidth, kHeight).status(), "gives no buffers: Invalid argument");
  const auto broken = [&](const char* name, const std::string& wanted) {
    auto sink = open_output(output, kWidth, kHeight);
    check(sink.ok(), "opened again, after an error before");
    if (!sink.ok()) return;
    check(shows(**sink, pixels), "a frame before the error");
    check(out.set(name, 1), std::string("control: ") + name);
    check_says(show_until_refused(**sink, pixels), wanted);
  };
  broken("Inject VIDIOC_QBUF Error", "takes no frame: Invalid argument");
  broken("Inject Fatal Streaming Error", "Input/output error");
  {
    auto sink = open_output(output, kWidth, kHeight);
    check(sink.ok(), "opened again, after an error before");
    if (sink.ok()) {
      check(show_until_refused(**sink, pixels).ok(), "a second of frames");
      bool taken = true;
      const bool counted = until_broken(out, [&] {
        taken = taken && shows(**sink, pixels);
        return (*sink)->broken_buffers() > 0;
      });
      check(taken && counted, "a broken buffer is counted and no error");
    }
  }
  broken("Disconnect", "the device is gone");  // last: there is no way back
}

void run() {
  check(load_modules(), "modules");
  const std::string output = find_node(V4L2_CAP_VIDEO_OUTPUT),
                    input = find_node(V4L2_CAP_VIDEO_CAPTURE);
  check(!output.empty() && !input.empty(), "vivid's nodes " + output + " " + input);
  if (output.empty() || input.empty()) return;
  const Node out(output), in(input);
  check(in.set("OSD Text Mode", 2), "no text in the picture");
  // Since Linux 6.11 an input names the output that it is connected to; before it was a switch.
  check(in.set_last("Is Connected To") || out.set("Loop Video", 1) || in.set("Loop Video", 1),
        "output and input are connected");
  frames_come_back(output, out, in);
  pictures_come_in(output, input, out, in);
  it_says_why(output, input, out);
}

}  // namespace
}  // namespace figurine::tests

int main() {
  figurine::tests::run();
  std::printf("RESULT passed %d failed %d\n", figurine::tests::passed, figurine::tests::failed);
  std::fflush(stdout);
  ::sync();
  ::reboot(RB_POWER_OFF);
}
