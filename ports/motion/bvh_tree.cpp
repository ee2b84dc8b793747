// A BVH as a tree of moving nodes.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "ports/motion/clip_tree.h"

namespace figurine::ports {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

class BvhTree : public ClipTree {
 public:
  explicit BvhTree(Bvh bvh) : bvh_(std::move(bvh)) {
    where = bvh_.where;
    note = bvh_.note;
    for (const BvhJoint& joint : bvh_.joints) {
      names.push_back(joint.name);
      parents.push_back(joint.parent);
      bool turns = false, is_placed = false;
      for (size_t c = 0; c < joint.channels.size(); ++c) {
        const size_t column = joint.first_channel + c;
        float lowest = bvh_.values[column], highest = lowest;
        for (uint32_t f = 1; f < bvh_.frame_count; ++f) {
          const float value = bvh_.values[size_t{f} * bvh_.channel_count + column];
          lowest = std::min(lowest, value);
          highest = std::max(highest, value);
        }
        turns |= lowest < highest;
        is_placed |= joint.channels[c] <= BvhChannel::kZPosition && (lowest != 0 || highest != 0);
      }
      moved.push_back(turns);
      // Some exporters write positions of zero where they mean "at the offset".
      placed_.push_back(joint.parent < 0 || is_placed);
      const bool has_positions =
          std::any_of(joint.channels.begin(), joint.channels.end(),
                      [](BvhChannel channel) { return channel <= BvhChannel::kZPosition; });
      const bool has_offset = joint.offset != std::array<double, 3>{0, 0, 0};
      at_offset_ += has_positions && has_offset && !placed_.back();
    }
    if (at_offset_ > 0) {
      note += (note.empty() ? "" : "; ") + std::to_string(at_offset_) +
              " joints with positions of zero stay at their offsets";
    }
  }

  Status choose(const JointNodes&, const RetargetOptions& options) override {
    frames = bvh_.frame_count;
    frames_per_second = options.source_fps ? double{*options.source_fps} : 1 / bvh_.frame_time_s;
    return {};
  }
  Result<WorldPose> zero_pose() const override { return pose(nullptr); }
  Result<WorldPose> at(uint32_t frame) const override {
    return pose(&bvh_.values[size_t{frame} * bvh_.channel_count]);
  }

 private:
  // values == nullptr: the hierarchy's own zero pose.
  WorldPose pose(const float* values) const {
    WorldPose pose{std::vector<Quat>(bvh_.joints.size()), std::vector<Vec3>(bvh_.joints.size())};
    for (size_t j = 0; j < bvh_.joints.size(); ++j) {
      const BvhJoint& joint = bvh_.joints[j];
      Vec3 offset(joint.offset[0], joint.offset[1], joint.offset[2]);
      Quat rotation = no_turn();
      for (size_t c = 0; values != nullptr && c < joint.channels.size(); ++c) {
        const double value = values[joint.first_channel + c];
        const int axis = static_cast<int>(joint.channels[c]) % 3;
        if (joint.channels[c] <= BvhChannel::kZPosition) {
          if (placed_[j]) offset[axis] = value;  // in place of the offset
        } else {
          Vec3 about_axis(0);
          about_axis[axis] = 1;
          rotation = product(rotation, about(about_axis, value * kDegree));
        }
      }
      const size_t parent = static_cast<size_t>(joint.parent);
      pose.rotation[j] = joint.parent < 0 ? rotation : product(pose.rotation[parent], rotation);
      pose.position[j] = joint.parent < 0
                             ? offset
                             : pose.position[parent] + rotated(pose.rotation[parent], offset);
    }
    return pose;
  }

  Bvh bvh_;
  std::vector<bool> placed_;  // by its position channels
  size_t at_offset_ = 0;      // joints whose position channels say nothing
};

}  // namespace

Result<std::unique_ptr<ClipTree>> bvh_tree(Bvh bvh, const RetargetOptions& options) {
  if (bvh.frame_time_s == 0 && !options.source_fps) {
    return Status(
        StatusCode::kInvalidArgument,
        bvh.where + ": Frame Time: not within 0.001 and 1 s; --source-fps gives the rate");
  }
  if (bvh.frame_count > kMaxClipFrames)
    return Status(StatusCode::kLimitExceeded, bvh.where + ": Frames: more than 2^18");
  return std::unique_ptr<ClipTree>(std::make_unique<BvhTree>(std::move(bvh)));
}

}  // namespace figurine::ports
