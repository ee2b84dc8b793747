#include "samples/common/v4l2_sink.h"

namespace figurine::samples {

Result<std::unique_ptr<V4l2Sink>> V4l2Sink::open(const std::string& path, ImageSize size,
                                                 const Options& options,
                                                 ports::VideoSystem* system) {
  Result<std::unique_ptr<ports::V4l2Output>> output =
      ports::V4l2Output::open(path, {.width_px = size.width_px,
                                     .height_px = size.height_px,
                                     .frames_per_second = options.frames_per_second,
                                     .now_ns = options.now_ns,
                                     .system = system});
  if (!output.ok()) return output.status();
  return std::unique_ptr<V4l2Sink>(new V4l2Sink(std::move(*output), options));
}

Result<bool> V4l2Sink::put(const RenderedFrame& frame, uint64_t deadline_ns) {
  return output_->show(frame.format == PixelFormat::kRgb24 ? frame.u8.pixels : frame.packed,
                       deadline_ns);
}

}  // namespace figurine::samples
