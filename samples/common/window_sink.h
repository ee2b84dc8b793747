// Live video into a window: what stands behind "window".
#pragma once

#include <memory>

#include "ports/sdl/window.h"
#include "samples/common/live_sink.h"

namespace figurine::samples {

class WindowSink final : public LiveSink {
 public:
  // Errors: Window::open.
  static Result<std::unique_ptr<WindowSink>> open(ImageSize size, const Options& options);
  PixelFormat format() const override { return PixelFormat::kRgba8; }
  bool closed() override { return !window_->poll(); }

 private:
  WindowSink(std::unique_ptr<ports::Window> window, const Options& options)
      : LiveSink(options), window_(std::move(window)) {}
  Result<bool> put(const RenderedFrame& frame, uint64_t deadline_ns) override;

  std::unique_ptr<ports::Window> window_;
};

}  // namespace figurine::samples
