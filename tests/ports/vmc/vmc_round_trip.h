// How far a pose is from itself after it was sent by VMC and read again: motion -> bones of a
// sender
// -> datagrams -> bones -> joints.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/motion.h"
#include "ports/vmc/vmc_sender.h"
#include "ports/vmc/vmc_state.h"

namespace figurine::tests {

struct RoundTrip {
  double worst_deg = 0;  // of any joint with a humanoid bone, in any frame
  std::string worst_joint;
  double worst_root_m = 0;
  uint64_t datagrams = 0, malformed = 0, dropped = 0;
};

// The angle between two rotations, wxyz of any length. In double by the sine of the half: the
// cosine of a small angle says nothing in floats.
inline double angle_deg(const float* a, const float* b) {
  const glm::dquat p = glm::normalize(glm::dquat(a[0], a[1], a[2], a[3])),
                   q = glm::normalize(glm::dquat(b[0], b[1], b[2], b[3]));
  const glm::dquat d = glm::conjugate(p) * q;
  return 2 * std::atan2(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z), std::abs(d.w)) * 180 /
         3.14159265358979323846;
}

inline RoundTrip measure_round_trip(const Body& body, const Motion& motion, size_t datagram_bytes) {
  const ports::HumanoidRig rig =
      std::move(ports::HumanoidRig::create(body.joint_names, body.mean_skeleton())).value();
  RoundTrip result;
  ports::VmcState state;
  std::vector<float> rotations(4 * rig.joint_count());
  std::array<float, 3> root{};
  for (uint32_t frame = 0; frame < motion.frame_count; ++frame) {
    const PoseView sent = motion.pose(frame);
    for (const OscWriter& datagram :
         vmc_datagrams(rig.from_body(sent), frame / motion.frames_per_second, datagram_bytes))
      state.receive(datagram.packet(), frame);
    rig.to_body(state.pose(), rotations, root);
    ports::ease_to_rest(state.presence(frame), rotations, root);
    for (size_t j = 0; j < rig.joint_count(); ++j) {
      if (rig.bone_of(j) < 0) continue;
      const double angle = angle_deg(&sent.rotations[4 * j], &rotations[4 * j]);
      if (!(angle <= result.worst_deg)) {
        result.worst_deg = angle;
        result.worst_joint = body.joint_names[j];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      const double moved = std::abs(double(root[k]) - double(sent.root_translation_m[k]));
      result.worst_root_m = std::max(result.worst_root_m, moved);
    }
  }
  result.datagrams = state.counts().packets;
  result.malformed = state.counts().malformed;
  result.dropped = state.counts().dropped;
  return result;
}

}  // namespace figurine::tests
