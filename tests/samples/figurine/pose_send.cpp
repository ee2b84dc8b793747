// Sends the poses of a motion as records (docs/poses.md), to try `figurine live --pose -`:
//
//   pose_send MOTION.fgn [--frame N] [--seconds S] | figurine live AVATAR.fgn --pose - -o window
//
// With --frame that one, and the end; otherwise all, at the motion's rate, again and again until S.
#include <cstdio>
#include <cstdlib>
#include <string>

#include "ports/host/clock.h"
#include "samples/common/loading.h"
#include "samples/common/pose_record.h"

namespace {

using namespace figurine;

bool send(const Motion& motion, uint32_t frame) {
  const std::vector<std::byte> record = samples::write_pose_record(motion.pose(frame));
  return std::fwrite(record.data(), 1, record.size(), stdout) == record.size() &&
         std::fflush(stdout) == 0;
}

int run(const std::string& path, long frame, double seconds) {
  const auto loaded = samples::load_package(path, PackageKind::kMotion);
  if (!loaded.ok()) {
    std::fprintf(stderr, "pose_send: %s\n", loaded.status().message().c_str());
    return 1;
  }
  const Motion& motion = (*loaded)->package.motion();
  if (frame >= 0) return send(motion, static_cast<uint32_t>(frame) % motion.frame_count) ? 0 : 1;
  const uint64_t start_ns = ports::now_ns();
  const double rate = motion.frames_per_second;
  for (uint64_t i = 0; static_cast<double>(i) < seconds * rate; ++i) {
    ports::sleep_until(start_ns + static_cast<uint64_t>(static_cast<double>(i) * 1e9 / rate));
    if (!send(motion, static_cast<uint32_t>(i % motion.frame_count))) return 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string path;
  long frame = -1;
  double seconds = 1e9;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--frame" && i + 1 < argc) {
      frame = std::atol(argv[++i]);
    } else if (word == "--seconds" && i + 1 < argc) {
      seconds = std::atof(argv[++i]);
    } else {
      path = word;
    }
  }
  if (path.empty()) {
    std::fprintf(stderr, "pose_send MOTION.fgn [--frame N] [--seconds S]\n");
    return 2;
  }
  return run(path, frame, seconds);
}
