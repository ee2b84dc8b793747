// A glTF animation as a tree of moving nodes, sampled at the result's rate from the first key to
// the last.
#include <algorithm>
#include <cmath>

#include "ports/motion/clip_tree.h"

namespace figurine::ports {
namespace {

constexpr double kMaxPlace = 1e9;  // of a joint, in the file's unit

class GltfTree : public ClipTree {
 public:
  GltfTree(Gltf gltf, std::span<const std::byte> bytes) : bytes_(bytes) { take(std::move(gltf)); }

  Status choose(const JointNodes& joints, const RetargetOptions& options) override {
    needed_.assign(names.size(), false);
    for (const int joint : joints.node) {
      for (int n = joint; n >= 0 && !needed_[static_cast<size_t>(n)];
           n = parents[static_cast<size_t>(n)])
        needed_[static_cast<size_t>(n)] = true;
    }
    const auto moves_it = [&](size_t number) {
      return std::any_of(gltf_.moved[number].begin(), gltf_.moved[number].end(),
                         [&](uint32_t node) { return needed_[node]; });
    };
    if (!options.animation && !moves_it(gltf_.animation)) {
      for (uint32_t a = 0; a < gltf_.moved.size(); ++a) {
        if (!moves_it(a)) continue;
        Result<Gltf> again = parse_gltf(bytes_, where, a);
        if (!again.ok()) return again.status();
        take(std::move(again).value());
        note = "animation " + std::to_string(a) + " is the first that moves the skeleton";
        break;
      }
    }
    if (!options.animation && note.empty() && gltf_.moved.size() > 1)
      note = "animation " + std::to_string(gltf_.animation) + " of " +
             std::to_string(gltf_.moved.size());
    for (size_t n = 0; n < needed_.size(); ++n) {
      if (needed_[n] && !gltf_.nodes[n].defect.empty())
        return Status(StatusCode::kCorrupt, where + ": " + gltf_.nodes[n].defect);
    }
    double first = 1e30, last = -1;
    for (const GltfTrack& track : gltf_.tracks) {
      if (!needed_[track.node]) continue;
      first = std::min(first, double{track.times_s.front()});
      last = std::max(last, double{track.times_s.back()});
    }
    const std::string name = where + ": animations[" + std::to_string(gltf_.animation) + "]: ";
    if (last < 0) return Status(StatusCode::kCorrupt, name + "moves none of the skeleton's joints");
    frames_per_second = double{options.frames_per_second};
    if (!(frames_per_second >= 1 && frames_per_second <= 240))
      return Status(StatusCode::kInvalidArgument, "fps: not within 1 and 240");
    first_s_ = first;
    // Times are floats: a clip of one second at 30 has 31 frames although its last key may be a
    // little early.
    const double count = std::floor((last - first) * frames_per_second + 1e-3) + 1;
    if (count > kMaxClipFrames)
      return Status(StatusCode::kLimitExceeded, name + "more than 2^18 frames");
    frames = static_cast<uint32_t>(count);
    return {};
  }

  Result<WorldPose> zero_pose() const override {
    std::vector<GltfTransform> rest;
    for (const GltfNode& node : gltf_.nodes) rest.push_back(node.rest);
    return world(rest);
  }
  Result<WorldPose> at(uint32_t frame) const override {
    return world(gltf_.at(first_s_ + frame / frames_per_second));
  }

 private:
  void take(Gltf gltf) {
    gltf_ = std::move(gltf);
    where = gltf_.where;
    animation = gltf_.animation;
    human_bones = gltf_.human_bones;
    names.clear();
    parents.clear();
    for (const GltfNode& node : gltf_.nodes) {
      names.push_back(node.name);
      parents.push_back(node.parent);
    }
    // By this animation; by any of them where this one is a prop's or a camera's.
    constexpr size_t kFewNodes = 3;
    const bool is_few = gltf_.moved[gltf_.animation].size() < kFewNodes;
    moved.assign(names.size(), false);
    for (size_t a = 0; a < gltf_.moved.size(); ++a) {
      if (a != gltf_.animation && !is_few) continue;
      for (const uint32_t node : gltf_.moved[a]) moved[node] = true;
    }
  }

  // Rotations are the product of the rotations alone: scales of a skeleton's joints squash limbs,
  // they do not turn them.
  Result<WorldPose> world(const std::vector<GltfTransform>& local) const {
    WorldPose pose{std::vector<Quat>(local.size()), std::vector<Vec3>(local.size())};
    std::vector<Mat3> linear(local.size());
    for (const uint32_t n : gltf_.order) {
      if (!needed_[n]) continue;
      const GltfTransform& own = local[n];
      const Mat3 turned = scaled(matrix_of(own.rotation), own.scale);
      double largest = 0;
      if (gltf_.nodes[n].parent < 0) {
        pose.rotation[n] = own.rotation;
        pose.position[n] = own.translation;
        linear[n] = turned;
      } else {
        const size_t parent = static_cast<size_t>(gltf_.nodes[n].parent);
        pose.rotation[n] = unit(product(pose.rotation[parent], own.rotation));
        pose.position[n] = pose.position[parent] + product(linear[parent], own.translation);
        linear[n] = product(linear[parent], turned);
      }
      for (int i = 0; i < 3; ++i) largest += length(linear[n][i]);
      // Scales multiply down the tree, at last out of the range of a double.
      if (!(length(pose.position[n]) <= kMaxPlace) || !std::isfinite(largest)) {
        return Status(StatusCode::kCorrupt, where + ": nodes[" + std::to_string(n) +
                                                "]: its place in the world is out of range");
      }
    }
    return pose;
  }

  Gltf gltf_;
  std::span<const std::byte> bytes_;
  std::vector<bool> needed_;  // joints, and what they hang on
  double first_s_ = 0;
};

}  // namespace

Result<std::unique_ptr<ClipTree>> gltf_tree(std::span<const std::byte> bytes,
                                            const std::string& where,
                                            const RetargetOptions& options) {
  Result<Gltf> gltf = parse_gltf(bytes, where, options.animation.value_or(0));
  if (!gltf.ok()) return gltf.status();
  return std::unique_ptr<ClipTree>(std::make_unique<GltfTree>(std::move(gltf).value(), bytes));
}

}  // namespace figurine::ports
