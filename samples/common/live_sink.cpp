#include "samples/common/live_sink.h"

#include <cmath>

namespace figurine::samples {

LiveSink::LiveSink(const Options& options)
    : options_(options),
      interval_ns_(static_cast<uint64_t>(std::llround(1e9 / options.frames_per_second))) {
  FIG_CHECK(options.frames_per_second >= 0.01 && options.frames_per_second <= 1000,
            "0.01 to 1000 frames a second");
}

bool LiveSink::drop_late(uint64_t due_ns) {
  if (now_ns() < next_due_ns(due_ns)) return false;
  ++counts_.dropped;
  return true;
}

Result<bool> LiveSink::show(const RenderedFrame& frame, uint64_t due_ns) {
  FIG_CHECK(frame.format == format(), "frames of the sink's format");
  if (drop_late(due_ns)) return false;
  const Result<bool> shown = put(frame, next_due_ns(due_ns));
  if (shown.ok()) ++(*shown ? counts_.shown : counts_.dropped);
  return shown;
}

}  // namespace figurine::samples
