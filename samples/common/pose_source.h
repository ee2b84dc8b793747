// Where poses come from as time goes by: recorded motions here, made-up ones, and live ones in the
// ports to come. A picture asks for the pose of its own time; how a source finds it is its
// business.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "figurine/motion.h"
#include "figurine/pose.h"
#include "figurine/status.h"

namespace figurine::samples {

class PoseSource {
 public:
  virtual ~PoseSource() = default;
  // The pose at time_s, seconds from the source's beginning, 0 or more; valid until the next call.
  // Times of successive calls do not fall. A live source gives the newest pose that it has. Error:
  // no pose can come any more; recorded and made-up sources have none. Allocates nothing.
  virtual Result<PoseView> next(double time_s) = 0;
};

// One pose for ever. Borrows the pose's rotations.
class StillPose final : public PoseSource {
 public:
  explicit StillPose(const PoseView& pose) : pose_(pose) {}
  Result<PoseView> next(double) override { return pose_; }

 private:
  PoseView pose_;
};

// The frame of a motion that is nearest in time; the motion begins again when it is over. Borrows
// the motion.
class MotionPoses final : public PoseSource {
 public:
  explicit MotionPoses(const Motion& motion) : motion_(motion) {}
  Result<PoseView> next(double time_s) override;
  // When a frame is due: next() of it gives exactly that frame.
  double time_s(uint32_t frame) const { return frame / double(motion_.frames_per_second); }

 private:
  const Motion& motion_;
};

// A made-up motion about a pose: every joint sways a few degrees, differently at each moment, and
// no two moments of a run share a pose. For measuring: nothing of a frame can be reused.
class SwayPoses final : public PoseSource {
 public:
  static constexpr double kMomentsPerSecond = 30;
  explicit SwayPoses(const PoseView& pose);
  Result<PoseView> next(double time_s) override;

 private:
  std::array<float, 3> root_translation_m_;
  std::vector<float> about_, rotations_;  // [J,4]
};

}  // namespace figurine::samples
