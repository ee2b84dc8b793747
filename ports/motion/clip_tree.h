// A clip as a tree of nodes that move: what BVH and glTF have in common.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "figurine/status.h"
#include "ports/motion/bvh.h"
#include "ports/motion/gltf.h"
#include "ports/motion/retarget.h"

namespace figurine::ports {

// Nodes in the world of the file, in its unit.
struct WorldPose {
  std::vector<Quat> rotation;
  std::vector<Vec3> position;
};

class ClipTree {
 public:
  virtual ~ClipTree() = default;

  std::string where;               // the file, for messages
  std::vector<std::string> names;  // of nodes
  std::vector<int> parents;        // in any order; -1: none
  std::vector<std::pair<std::string, uint32_t>> human_bones;
  std::vector<bool> moved;  // by the animation that is chosen
  double frames_per_second = 0;
  uint32_t frames = 0;
  uint32_t animation = 0;  // glTF: that is read
  std::string note;        // what was odd about the file, in words; empty: nothing

  // Looks at the joints alone: errors of other nodes do not matter. Sets rate and frames. Call
  // once, before the poses.
  virtual Status choose(const JointNodes& joints, const RetargetOptions& options) = 0;
  virtual Result<WorldPose> zero_pose() const = 0;
  virtual Result<WorldPose> at(uint32_t frame) const = 0;
};

// kInvalidArgument for a rate that is missing or out of range.
Result<std::unique_ptr<ClipTree>> bvh_tree(Bvh bvh, const RetargetOptions& options);
// Parses the file, if need be again for the animation that moves the skeleton.
Result<std::unique_ptr<ClipTree>> gltf_tree(std::span<const std::byte> bytes,
                                            const std::string& where,
                                            const RetargetOptions& options);

inline constexpr uint32_t kMaxClipFrames = 1u << 18;  // 55 rotations each: 460 MB

}  // namespace figurine::ports
