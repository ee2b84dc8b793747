#include "ports/motion/gaze.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "ports/motion/rotation.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {
namespace {

Quat rotation(const MotionClip& clip, uint32_t frame, uint32_t joint) {
  const float* q = &clip.rotations[(size_t{frame} * kJointCount + joint) * 4];
  return unit(Quat(q[0], q[1], q[2], q[3]));
}

double head_pitch(const MotionClip& clip, uint32_t frame) {
  Quat world_from_head = no_turn();
  for (int joint = kHead; joint >= 0; joint = joint_parents()[static_cast<size_t>(joint)])
    world_from_head = product(rotation(clip, frame, static_cast<uint32_t>(joint)), world_from_head);
  return std::asin(std::clamp(rotated(world_from_head, Vec3(0, 0, 1)).y, -1.0, 1.0));
}

// About the joint's own x axis; a positive angle lifts the face.
void turn_up(MotionClip& clip, uint32_t joint, double angle_rad) {
  const Quat up = about(Vec3(1, 0, 0), -angle_rad);
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const Quat turned = product(rotation(clip, f, joint), up);
    float* q = &clip.rotations[(size_t{f} * kJointCount + joint) * 4];
    q[0] = static_cast<float>(turned.w);
    q[1] = static_cast<float>(turned.x);
    q[2] = static_cast<float>(turned.y);
    q[3] = static_cast<float>(turned.z);
  }
}

}  // namespace

HeadPitch measure_head_pitch(const MotionClip& clip) {
  double sum = 0, lowest = std::numbers::pi, highest = -lowest;
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const double pitch = head_pitch(clip, f);
    sum += pitch;
    lowest = std::min(lowest, pitch);
    highest = std::max(highest, pitch);
  }
  return {static_cast<float>(sum / clip.frame_count), static_cast<float>(lowest),
          static_cast<float>(highest)};
}

Result<MotionClip> with_head_pitch(MotionClip clip, float mean_rad) {
  constexpr int kSteps = 20;  // a head held askew rises by less than it turns, so one is not enough
  constexpr double kNear_rad = 0.1 * std::numbers::pi / 180;
  double turned_rad = 0;  // of each joint
  for (int step = 0; step < kSteps; ++step) {
    const double missing_rad = double{mean_rad} - double{measure_head_pitch(clip).mean_rad};
    if (std::fabs(missing_rad) < kNear_rad) {
      make_continuous(clip.rotations, kJointCount);
      return clip;
    }
    turned_rad += missing_rad / 2;
    if (std::fabs(turned_rad) > double{kMostNeckTurn_rad}) break;
    for (const uint32_t joint : {uint32_t{kNeck}, uint32_t{kHead}})
      turn_up(clip, joint, missing_rad / 2);
  }
  return Status(StatusCode::kInvalidArgument,
                "motion " + clip.name + ": no neck turns as far as this head pitch needs");
}

}  // namespace figurine::ports
