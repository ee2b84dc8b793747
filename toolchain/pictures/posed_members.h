// Members of a population in many poses, each seen from several sides: what figurine-features
// learns from and is judged by. Poses, cameras and their framing come from training members alone;
// which members are drawn is the caller's choice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "toolchain/pictures/member_pictures.h"

namespace figurine::pictures {

struct PosedMembersOptions {
  const Motion* motion =
      nullptr;            // whose poses are drawn; without: golden poses of training members
  size_t first_pose = 0;  // of fixed_poses(first_pose + poses)
  size_t poses = 8, views = 6;
  uint64_t seed = 1;  // of the cameras
  uint32_t threads = 1;
  bool quiet = false;
};

// Members of one part, in the population's order.
std::vector<size_t> members_of(const Population& population, Split split);

class PosedMembers {
 public:
  // Both packages are borrowed. Throws InputError if they do not fit, or if nothing can be seen;
  // Interrupted.
  PosedMembers(const Package& population, const Package& body, const PosedMembersOptions& options);

  size_t shots() const { return options_.poses * options_.views; }
  size_t pose_of(size_t shot) const { return shot / options_.views; }
  size_t view_of(size_t shot) const { return shot % options_.views; }
  uint32_t picture_px() const { return picture_px_; }  // side

  // take(i, pictures of members[i], one a shot), several at a time on different threads.
  void draw(const std::string& what, std::span<const size_t> members,
            const std::function<void(size_t, std::vector<measure::Picture>)>& take) const;

 private:
  const Population* population_;
  PosedMembersOptions options_;
  uint32_t picture_px_;
  std::optional<ShotRenderer> renderer_;
};

}  // namespace figurine::pictures
