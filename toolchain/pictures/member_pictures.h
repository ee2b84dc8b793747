// Pictures of a population's members that can be compared: everybody in the same poses, seen by the
// same cameras, drawn by the device's renderer in float. Cameras are framed once, on all members,
// so that one scale fits everybody.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "toolchain/measure/metrics.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/owned_pose.h"

namespace figurine::verify {
class DeviceAvatar;
}

namespace figurine::pictures {

// What a shot shows of everybody: the person where the pose puts it, the person moved up or down
// until it stands on the same ground, or its head and shoulders, moved until they are in the middle
// (bodies with a joint called "head").
enum class Subject : uint8_t { kPlaced, kGrounded, kBust };

// From where a pose is looked at. Azimuth 0 sees the person's front, of a bust the face's; positive
// angles move the camera to its left.
struct Shot {
  size_t pose = 0;
  float azimuth_deg = 0;
  float elevation_deg = 5;
  Subject subject = Subject::kPlaced;
};

// What a person takes up of a shot: tangents x/z and y/z of the camera's axes.
struct Extent {
  float left = 1e9f, right = -1e9f, top = 1e9f, bottom = -1e9f;
  void add(const Extent& other);
  float aspect() const { return (right - left) / (bottom - top); }  // width over height
};

class ShotRenderer {
 public:
  ShotRenderer(const Package& body, std::vector<train::OwnedPose> poses, std::vector<Shot> shots);

  const std::vector<Shot>& shots() const { return shots_; }
  PoseView pose(size_t shot) const { return poses_[shots_[shot].pose].view(); }
  const Camera& camera(size_t shot) const {
    return cameras_[shot];
  }  // of no size before it is framed
  // Where the avatar, or its bust, appears in every shot but for the 0.2 % of its Gaussians that
  // lie farthest out on each side.
  std::vector<Extent> look(const Avatar& avatar) const;
  // The shot's camera: the largest scale at which the extent fits into the picture but for a margin
  // of its sides.
  void frame(size_t shot, const Extent& extent, uint32_t width_px, uint32_t height_px,
             float margin);
  // Shots [first, end), which must have been framed.
  std::vector<measure::Picture> draw(const Avatar& avatar, size_t first, size_t end) const;

 private:
  template <class Visit>
  void each_shot(const Avatar& avatar, size_t first, size_t end, Visit&& visit) const;

  std::array<float, 3> displacement_m(const Shot& shot, std::span<const float> centres_m) const;

  const Package* body_;
  std::vector<uint32_t> bust_;  // texels
  std::vector<train::OwnedPose> poses_;
  std::vector<Shot> shots_;
  std::vector<Camera> cameras_;  // [shots]
};

// Work of many equal pieces: spread over threads, interruptible, with a progress line. The first
// exception of a piece is thrown again.
class Crew {
 public:
  Crew(uint32_t threads, bool quiet) : threads_(threads), quiet_(quiet) {}
  // Throws Interrupted at Ctrl-C. piece(i) for i in [0, count), several at a time.
  void run(const std::string& what, size_t count, const std::function<void(size_t)>& piece) const;

 private:
  uint32_t threads_;
  bool quiet_;
  train::InterruptGuard interrupt_;
};

}  // namespace figurine::pictures
