// Frames to somebody who watches as they come: a camera device, a window, a pipe. Show or drop: a
// frame whose time has passed before it is drawn, or that nobody takes in time, is dropped and
// counted, never queued. What was drawn is shown however long that took: it is the newest picture
// that there is, and a machine too slow for the rate shows fewer pictures, not none. For files,
// which need every frame: file_sink.h.
//
//   for (uint64_t due_ns = now_ns();; due_ns += interval_ns) {
//     sleep_until(due_ns);
//     if (sink->drop_late(due_ns)) continue;   // behind: spares the work
//     ... pose and render ...
//     FIG_RETURN_IF_ERROR(sink->show(frame, due_ns).status());
//   }
#pragma once

#include <cstdint>

#include "ports/host/clock.h"
#include "samples/common/rendered_frame.h"

namespace figurine::samples {

class LiveSink {
 public:
  struct Options {
    double frames_per_second = 30;  // above 0
    uint64_t (*now_ns)() = ports::now_ns;
  };
  struct Counts {
    uint64_t shown = 0;
    uint64_t late = 0;  // of those shown: when the one after was due already
    uint64_t dropped = 0;
  };

  virtual ~LiveSink() = default;
  LiveSink(const LiveSink&) = delete;
  LiveSink& operator=(const LiveSink&) = delete;

  // What frames must be.
  virtual PixelFormat format() const = 0;
  // By which matrix, where that format is YCbCr.
  virtual YcbcrMatrix matrix() const { return YcbcrMatrix::kBt601; }

  // Whether the frame of due_ns is too late, because the one after it is due already; counted as
  // dropped then. For callers that ask before they render.
  bool drop_late(uint64_t due_ns);
  // Shows the frame of format() that was due at due_ns, or drops it; says which. Waits for a slow
  // receiver until a frame is due again, no longer; not for the frame's own time: pace is the
  // caller's. Error: the receiver is gone.
  Result<bool> show(const RenderedFrame& frame, uint64_t due_ns);
  // Whether who watches wants no more of it, which is no error: a window that was closed. Once for
  // every frame that is due; a window takes in there what its user did.
  virtual bool closed() { return false; }
  // Gives the receiver what it has begun to take. Call once, at the end.
  virtual Status finish() { return {}; }

  const Counts& counts() const { return counts_; }

 protected:
  explicit LiveSink(const Options& options);
  uint64_t now_ns() const { return options_.now_ns(); }

 private:
  // Gives the receiver the frame before deadline_ns, or not at all (false). Keeps nothing of it but
  // what the receiver has begun to take.
  virtual Result<bool> put(const RenderedFrame& frame, uint64_t deadline_ns) = 0;
  Options options_;
  uint64_t interval_ns_;
  Counts counts_;
};

}  // namespace figurine::samples
