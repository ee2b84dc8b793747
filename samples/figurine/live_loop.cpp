#include "samples/figurine/live_loop.h"

#include <algorithm>
#include <cmath>

#include "ports/host/clock.h"
#include "samples/common/progress.h"

namespace figurine::samples {

namespace {

constexpr uint64_t kLook_ns = 50'000'000;  // a signal may wake another thread than this one

Status wait_until(uint64_t then_ns) {
  for (uint64_t now = ports::now_ns(); now < then_ns; now = ports::now_ns()) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    ports::sleep_until(std::min(then_ns, now + kLook_ns));
  }
  return check_interrupt();
}

// The frame that the sink gets, and what it is made of where a camera's picture is behind.
struct Pictures {
  explicit Pictures(const LiveLoop& loop)
      : frame(loop.size, loop.sink.format()),
        figures(loop.behind == nullptr ? ImageSize{0, 0} : loop.size, PixelFormat::kRgba8) {}
  RenderedFrame frame, figures;
  ports::ImageU8 scratch;
};

Status draw(LiveLoop& loop, double time_s, Pictures& pictures) {
  const Result<std::span<const FrameAvatar>> posed = loop.scene.pose_at(time_s);
  if (!posed.ok()) return posed.status();
  const Camera& camera = loop.camera.step(mean_place(loop.scene), 1 / loop.frames_per_second);
  const bool over = loop.behind != nullptr;
  ImageTarget target = over ? pictures.figures.target() : pictures.frame.target();
  target.matrix = loop.sink.matrix();
  Frame frame{.camera = camera,
              .avatars = *posed,
              .leave_out = loop.leave_out,
              .approximation = loop.approximation};
  if (!over) frame.background = loop.background;
  FIG_RETURN_IF_ERROR(loop.renderer.render(frame, target));
  if (over) {
    compose(pictures.figures, loop.behind->newest().get(), loop.background, loop.sink.matrix(),
            pictures.scratch, pictures.frame);
  }
  return {};
}

// Everything but how it ended, into run.
Status run_ticks(LiveLoop& loop, LiveRun& run) {
  Pictures pictures(loop);
  FIG_RETURN_IF_ERROR(draw(loop, 0, pictures));
  const uint64_t start_ns = ports::now_ns();
  std::optional<uint64_t> last_pose_ns;
  for (; !loop.ticks || run.ticks < *loop.ticks; ++run.ticks) {
    // Of the number, not of the tick before: no error adds up.
    const double time_s = static_cast<double>(run.ticks) / loop.frames_per_second;
    const uint64_t due_ns = start_ns + static_cast<uint64_t>(std::llround(time_s * 1e9));
    FIG_RETURN_IF_ERROR(wait_until(due_ns));
    run.seconds = static_cast<double>(ports::now_ns() - start_ns) * 1e-9;
    if (loop.sink.closed()) {
      run.end = LiveEnd::kClosed;
      return {};
    }
    if (loop.sink.drop_late(due_ns)) continue;
    if (loop.feed != nullptr) {
      FIG_RETURN_IF_ERROR(loop.feed->advance(ports::now_ns()));
      if (loop.feed->ended()) {
        run.end = LiveEnd::kPoses;
        return {};
      }
    }
    const uint64_t begin_ns = ports::now_ns();
    FIG_RETURN_IF_ERROR(draw(loop, time_s, pictures));
    const uint64_t drawn_ns = ports::now_ns();
    const Result<bool> shown = loop.sink.show(pictures.frame, due_ns);
    if (!shown.ok()) return shown.status();
    if (!*shown) continue;
    run.rendering.add(drawn_ns - begin_ns);
    run.pulled_poses += loop.renderer.statistics().pulled_poses;
    const std::optional<uint64_t> pose_ns =
        loop.feed == nullptr ? std::optional(due_ns) : loop.feed->arrived_ns();
    if (pose_ns && pose_ns != last_pose_ns) run.latency.add(ports::now_ns() - *pose_ns);
    last_pose_ns = pose_ns;
  }
  return {};
}

}  // namespace

std::array<float, 3> mean_place(const Scene& scene) {
  std::array<float, 3> mean{0, 0, 0};
  for (size_t f = 0; f < scene.size(); ++f) {
    const std::array<float, 3> root = scene.root_m(f);
    for (size_t k = 0; k < 3; ++k) mean[k] += root[k] / static_cast<float>(scene.size());
  }
  return mean;
}

const char* to_string(LiveEnd end) {
  switch (end) {
    case LiveEnd::kTicks:
      return "frames";
    case LiveEnd::kPoses:
      return "poses";
    case LiveEnd::kClosed:
      return "closed";
    case LiveEnd::kInterrupt:
      return "interrupt";
    case LiveEnd::kError:
      return "error";
  }
  return "";
}

LiveRun run_live(LiveLoop& loop) {
  LiveRun run;
  run.status = run_ticks(loop, run);
  if (!run.status.ok()) {
    run.end = run.status.code() == StatusCode::kInterrupted ? LiveEnd::kInterrupt : LiveEnd::kError;
  }
  return run;
}

}  // namespace figurine::samples
