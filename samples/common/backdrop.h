// What a camera sees, behind the figures of a live picture: read, decoded and scaled to the frame
// by a thread of its own, so that a slow camera slows nothing down. When the camera is lost that is
// said in a line, and the colour stands there again.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "ports/host/process.h"
#include "ports/v4l2/v4l2_capture.h"
#include "samples/common/rendered_frame.h"

namespace figurine::samples {

class Backdrop {
 public:
  struct Options {
    ImageSize size;  // of the frames
    double frames_per_second = 30;
    void (*say)(const std::string& line) = ports::say;
    ports::VideoSystem* system = nullptr;  // null: the machine's own
  };
  // Errors: V4l2Capture::open.
  static Result<std::unique_ptr<Backdrop>> open(const std::string& path, const Options& options);
  ~Backdrop();
  Backdrop(const Backdrop&) = delete;
  Backdrop& operator=(const Backdrop&) = delete;

  // RGB of the frames' size; null before the first picture and after the camera was lost.
  std::shared_ptr<const ports::ImageU8> newest() const;

  struct Counts {
    uint64_t pictures = 0, broken = 0;
    bool lost = false;
  };
  Counts counts() const;
  const std::string& path() const { return path_; }

 private:
  Backdrop(std::string path, const Options& options, std::unique_ptr<ports::V4l2Capture> capture);
  void run();

  std::string path_;
  Options options_;
  std::unique_ptr<ports::V4l2Capture> capture_;  // the thread's
  mutable std::mutex mutex_;                     // of what follows
  std::shared_ptr<const ports::ImageU8> newest_;
  Counts counts_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Figures over a picture, RGB of their size, or over a colour where that is null. figures: kRgba8;
// frame: of the same size and any format but kRgbaF32 and kBgra8 (FIG_CHECK), by that matrix where
// it is YCbCr. scratch: room for a picture, kept from frame to frame.
void compose(const RenderedFrame& figures, const ports::ImageU8* behind,
             const std::array<float, 3>& colour, YcbcrMatrix matrix, ports::ImageU8& scratch,
             RenderedFrame& frame);

}  // namespace figurine::samples
