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
  if (now_ns() < due_ns + interval_ns_) return false;
  ++counts_.dropped;
  return true;
}

Result<bool> LiveSink::show(const RenderedFrame& frame, uint64_t due_ns) {
  FIG_CHECK(frame.format == format(), "frames of the sink's format");
  const uint64_t now = now_ns();
  const uint64_t passed = now < due_ns ? 0 : (now - due_ns) / interval_ns_;
  const Result<bool> shown = put(frame, due_ns + (passed + 1) * interval_ns_);
  if (!shown.ok()) return shown;
  ++(*shown ? counts_.shown : counts_.dropped);
  if (*shown && passed > 0) ++counts_.late;
  return shown;
}

}  // namespace figurine::samples
