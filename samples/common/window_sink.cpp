#include "samples/common/window_sink.h"

namespace figurine::samples {

Result<std::unique_ptr<WindowSink>> WindowSink::open(ImageSize size, const Options& options) {
  Result<std::unique_ptr<ports::Window>> window =
      ports::Window::open({.width_px = size.width_px, .height_px = size.height_px});
  if (!window.ok()) return window.status();
  return std::unique_ptr<WindowSink>(new WindowSink(std::move(*window), options));
}

Result<bool> WindowSink::put(const RenderedFrame& frame, uint64_t) {
  FIG_RETURN_IF_ERROR(
      window_->set_picture(frame.u8.pixels, frame.size.width_px, frame.size.height_px));
  FIG_RETURN_IF_ERROR(window_->show_picture());
  return true;
}

}  // namespace figurine::samples
