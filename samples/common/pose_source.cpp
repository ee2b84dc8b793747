#include "samples/common/pose_source.h"

#include <cmath>

#include "samples/common/quaternion.h"

namespace figurine::samples {

Result<PoseView> MotionPoses::next(double time_s) {
  const auto frame = static_cast<uint64_t>(std::llround(time_s * motion_.frames_per_second));
  return motion_.pose(static_cast<uint32_t>(frame % motion_.frame_count));
}

SwayPoses::SwayPoses(const PoseView& pose)
    : root_translation_m_(pose.root_translation_m),
      about_(pose.rotations.begin(), pose.rotations.end()),
      rotations_(about_) {}

Result<PoseView> SwayPoses::next(double time_s) {
  constexpr double kReach_rad = 0.05;
  // Rates without a common period between joints and moments: no pose comes again.
  const double moment = time_s * kMomentsPerSecond + 1;
  for (size_t j = 0; j < about_.size() / 4; ++j) {
    const double angle = kReach_rad * std::sin(0.37 * moment + 2.399963 * static_cast<double>(j));
    glm::dvec3 axis(0);
    axis[static_cast<int>(j % 3)] = 1;
    store_quaternion(rotation_about(axis, 2 * angle) * quaternion_at(&about_[4 * j]),
                     &rotations_[4 * j]);
  }
  return PoseView{root_translation_m_, rotations_};
}

}  // namespace figurine::samples
