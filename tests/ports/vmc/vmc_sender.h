// What a VMC performer sends for a pose, as VirtualMotionCapture does: Unity's axes, one bundle or
// a message a datagram.
#pragma once

#include <string>
#include <vector>

#include "ports/vmc/humanoid.h"
#include "ports/vmc/osc_writer.h"

namespace figurine::tests {

inline OscWriter vmc_transform(std::string_view address, std::string_view name,
                               const glm::dvec3& place, const glm::dquat& turned) {
  const glm::dvec3 p = ports::mirror(place);
  const glm::dquat q = ports::mirror(turned);
  OscWriter writer;
  writer.message(address, "sfffffff").text(name);
  for (const double value : {p.x, p.y, p.z, q.x, q.y, q.z, q.w})
    writer.real(static_cast<float>(value));
  return writer;
}

inline OscWriter vmc_bone(std::string_view name, const glm::dquat& turned,
                          const glm::dvec3& place = {0, 0, 0}) {
  return vmc_transform("/VMC/Ext/Bone/Pos", name, place, turned);
}

inline OscWriter vmc_channel(std::string_view name, float value) {
  return std::move(OscWriter().message("/VMC/Ext/Blend/Val", "sf").text(name).real(value));
}

// All messages of a moment, in the order in which performers send them.
inline std::vector<OscWriter> vmc_messages(const ports::HumanoidPose& pose, double time_s) {
  std::vector<OscWriter> messages;
  messages.push_back(std::move(OscWriter().message("/VMC/Ext/OK", "i").word(1)));
  messages.push_back(
      std::move(OscWriter().message("/VMC/Ext/T", "f").real(static_cast<float>(time_s))));
  messages.push_back(vmc_transform("/VMC/Ext/Root/Pos", "root", pose.root_m, pose.root));
  for (size_t bone = 0; bone < ports::kHumanoidBones; ++bone) {
    messages.push_back(
        vmc_bone(ports::humanoid_bone_name(bone), pose.local[bone], pose.offset_m[bone]));
  }
  for (const char* name : {"Joy", "A", "Blink"}) messages.push_back(vmc_channel(name, 0.25f));
  messages.push_back(std::move(OscWriter().text("/VMC/Ext/Blend/Apply")));
  return messages;
}

// The same as datagrams: in bundles of at most so many bytes, or, for 0, one message each.
inline std::vector<OscWriter> vmc_datagrams(const ports::HumanoidPose& pose, double time_s,
                                            size_t most_bytes = 1400) {
  std::vector<OscWriter> messages = vmc_messages(pose, time_s);
  if (most_bytes == 0) return messages;
  std::vector<OscWriter> datagrams;
  for (const OscWriter& message : messages) {
    if (datagrams.empty() || datagrams.back().size() + 4 + message.size() > most_bytes)
      datagrams.push_back(std::move(OscWriter().bundle()));
    datagrams.back().element(message);
  }
  return datagrams;
}

}  // namespace figurine::tests
