// The figures of a picture: avatars with their bodies, motions and places, and each frame's poses.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "samples/figurine/loading.h"
#include "samples/figurine/parse.h"

namespace figurine::samples {

struct CastOptions {
  std::vector<std::string> avatars;
  std::string body;                  // empty: found by content hash
  std::vector<std::string> motions;  // none: the golden pose; one for all, or one for each avatar
  float spacing_m = 0.9f;            // between neighbours side by side, where no places are given
  std::vector<std::string> places;   // "X,Z[,HEADING]" for each avatar, or none
};

class Cast {
 public:
  // Loads and checks everything; nothing later can fail on data.
  static Result<Cast> load(const CastOptions& options);

  size_t size() const { return members_.size(); }
  bool moves() const { return frame_count_ > 1; }
  uint32_t frame_count() const { return frame_count_; }  // of the shortest motion; 1 without
  float frames_per_second() const { return frames_per_second_; }
  const LoadedAvatar& avatar(size_t member) const { return *members_[member].avatar; }
  const LoadedPackage& body(size_t member) const { return *members_[member].body; }
  // The frames of the range that exist. kInvalidArgument if it reaches beyond the motion.
  Result<std::vector<uint32_t>> frames(const FrameRange& range) const;

  // Adds every avatar, in the precision asked for or the best that it holds. Identities are kept in
  // order, one renderer at a time.
  Status add_to(Renderer& renderer, std::optional<Precision> precision);
  // What the avatars run in: "f32", "q8", or "mixed".
  std::string precision(const Renderer& renderer) const;
  // Whether every avatar holds it.
  bool holds(Precision precision) const;
  // Everybody's pose in a frame of the motion, at their places; valid until the next call.
  // Allocates nothing.
  std::span<const FrameAvatar> pose(uint32_t frame);
  // The same for a made-up moment of a cast without motion: every joint sways a few degrees about
  // its pose, differently at each moment.
  std::span<const FrameAvatar> sway(uint32_t moment);

  // World position of a member's root joint in the last pose.
  std::array<float, 3> root_m(size_t member) const;
  // Where a member looks in the last pose, in degrees about the vertical: 0 is +z, positive towards
  // +x.
  float heading_deg(size_t member) const;

 private:
  struct Member {
    std::shared_ptr<LoadedAvatar> avatar;
    std::shared_ptr<LoadedPackage> body, motion;
    Placement place;
    std::array<float, 3> rest_root_m{0, 0, 0};  // of the template that the Gaussians sit on
    std::vector<float> rotations;               // [J,4] of the last pose
    std::array<float, 3> root_translation_m{0, 0, 0};
  };
  void place_member(size_t member, const PoseView& pose);

  std::vector<Member> members_;
  std::vector<FrameAvatar> posed_;
  uint32_t frame_count_ = 1;
  float frames_per_second_ = 30;
};

}  // namespace figurine::samples
