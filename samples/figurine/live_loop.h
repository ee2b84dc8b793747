// The loop of `figurine live`: a frame at every tick of a steady clock, from the newest pose to the
// sink, until something ends it. What comes too late is dropped and counted, never queued.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "figurine/renderer.h"
#include "samples/common/backdrop.h"
#include "samples/common/follow_camera.h"
#include "samples/common/latency_histogram.h"
#include "samples/common/live_sink.h"
#include "samples/common/pose_feed.h"
#include "samples/common/scene.h"

namespace figurine::samples {

// The mean place of the figures' root joints in the scene's last pose: what the camera goes along
// with.
std::array<float, 3> mean_place(const Scene& scene);

struct LiveLoop {
  Scene& scene;
  Renderer& renderer;
  LiveSink& sink;
  Backdrop* behind = nullptr;  // null: the background colour alone
  PoseFeed* feed = nullptr;    // null: recorded poses, whose own time is that of arrival
  FollowCamera camera;
  ImageSize size;
  std::array<float, 3> background{};
  LeaveOut leave_out;
  Approximation approximation;
  double frames_per_second = 30;
  std::optional<uint64_t> ticks;  // so many, dropped ones counted; none: until told otherwise
};

enum class LiveEnd : uint8_t { kTicks, kPoses, kClosed, kInterrupt, kError };
const char* to_string(LiveEnd end);

struct LiveRun {
  LiveEnd end = LiveEnd::kTicks;
  Status status;               // of kInterrupt and kError
  uint64_t ticks = 0;          // frames that were due
  double seconds = 0;          // from the first one's time
  LatencyHistogram latency;    // from a pose's arrival until its pixels were handed over; each pose
                               // once, of those that were shown
  LatencyHistogram rendering;  // of the frames that were shown
  uint64_t pulled_poses = 0;   // in those frames, of figures that kept to what they know
};

// Draws and shows; the first frame is drawn once before the clock runs, so that what a renderer
// does once is not late. Does not finish the sink.
LiveRun run_live(LiveLoop& loop);

}  // namespace figurine::samples
