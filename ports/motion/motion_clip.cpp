#include "ports/motion/motion_clip.h"

#include <cmath>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {

figurine::Motion MotionClip::view() const {
  figurine::Motion out;
  out.name = name;
  out.frames_per_second = frames_per_second;
  out.joint_names = ports::joint_names();
  out.frame_count = frame_count;
  out.root_translation_m = root_translation_m;
  out.rotations = rotations;
  return out;
}

OwnedPose MotionClip::pose(uint32_t frame) const {
  FIG_CHECK(frame < frame_count, "frame within the clip");
  OwnedPose out;
  for (size_t i = 0; i < 3; ++i)
    out.root_translation_m[i] = root_translation_m[size_t{frame} * 3 + i];
  const auto first =
      rotations.begin() + static_cast<std::ptrdiff_t>(size_t{frame} * kJointCount * 4);
  out.rotations.assign(first, first + kJointCount * 4);
  return out;
}

Result<MotionClip> read_motion_clip(const std::string& path) {
  const Result<MappedFile> file = MappedFile::open(path);
  if (!file.ok()) return file.status();
  const Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) return package.status();
  if (package->kind() != PackageKind::kMotion) {
    return Status(StatusCode::kMismatch,
                  path + ": a " + to_string(package->kind()) + " package, not a motion");
  }
  const Motion& motion = package->motion();
  if (motion.joint_names != joint_names())
    return Status(StatusCode::kMismatch, path + ": joint_names: not the 55 joints of SMPL-X");
  MotionClip clip;
  clip.name = motion.name;
  clip.frames_per_second = motion.frames_per_second;
  clip.frame_count = motion.frame_count;
  clip.root_translation_m.assign(motion.root_translation_m.begin(),
                                 motion.root_translation_m.end());
  clip.rotations.assign(motion.rotations.begin(), motion.rotations.end());
  return clip;
}

OwnedPose turned(OwnedPose pose, float angle_rad) {
  // Only the root's rotation changes: q' = (cos a/2, 0, sin a/2, 0) q. The translation stays, so
  // the figure turns where it stands.
  const double c = std::cos(0.5 * double{angle_rad}), s = std::sin(0.5 * double{angle_rad});
  const double w = pose.rotations[0], x = pose.rotations[1], y = pose.rotations[2],
               z = pose.rotations[3];
  pose.rotations[0] = static_cast<float>(c * w - s * y);
  pose.rotations[1] = static_cast<float>(c * x + s * z);
  pose.rotations[2] = static_cast<float>(c * y + s * w);
  pose.rotations[3] = static_cast<float>(c * z - s * x);
  return pose;
}

OwnedPose rest_pose() {
  OwnedPose pose;
  pose.rotations.assign(size_t{kJointCount} * 4, 0.0f);
  for (size_t j = 0; j < kJointCount; ++j) pose.rotations[4 * j] = 1;
  return pose;
}

void make_continuous(std::vector<float>& rotations, uint32_t joints) {
  const size_t stride = size_t{joints} * 4;
  for (size_t i = 0; i + 3 < rotations.size(); i += 4) {
    float* q = &rotations[i];
    const double length = std::sqrt(double{q[0]} * q[0] + double{q[1]} * q[1] +
                                    double{q[2]} * q[2] + double{q[3]} * q[3]);
    if (!(length >= 1e-6)) {
      q[0] = 1;
      q[1] = q[2] = q[3] = 0;
    } else {
      for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(q[k] / length);
    }
    if (i < stride) continue;
    const float* before = q - stride;
    const float dot = q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3];
    if (dot < 0) {
      for (int k = 0; k < 4; ++k) q[k] = -q[k];
    }
  }
}

}  // namespace figurine::ports
