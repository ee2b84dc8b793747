// The figures of a picture: avatars with their bodies, their poses and places, and what all of them
// do at a moment.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "samples/common/loading.h"
#include "samples/common/parse.h"
#include "samples/common/pose_json.h"
#include "samples/common/pose_source.h"

namespace figurine::samples {

struct SceneOptions {
  std::vector<std::string> avatars;
  std::vector<std::string> coarse;   // FrameAvatar::coarse: none, one for all, or one for each
  std::string body;                  // empty: found by content hash
  std::vector<std::string> motions;  // none: the golden pose; one for all, or one for each avatar
  std::vector<std::string> poses;    // in their place, of pose files (pose_json.h)
  float spacing_m = 0.9f;            // between neighbours side by side, where no places are given
  std::vector<std::string> places;   // "X,Z[,HEADING]" for each avatar, or none
  // Above 1: so many of every avatar in rows and columns, looking everywhere, each at a moment of
  // its own of what they do.
  uint32_t crowd = 1;
  // What the avatars' packages are opened for; with keep_to_known also for what poses they know.
  OpenOptions open;
  bool keep_to_known = false;  // FrameAvatar's, of every figure
};

class Scene {
 public:
  // Loads and checks everything; nothing later can fail on data.
  static Result<Scene> load(const SceneOptions& options);

  // Nobody; add_figure() brings somebody.
  Scene() = default;
  struct Newcomer {
    std::shared_ptr<LoadedAvatar> avatar;
    std::shared_ptr<LoadedPackage> body;    // that the avatar was made for
    std::shared_ptr<LoadedPackage> motion;  // null: stands in the golden pose
    Placement place;
  };
  // Who draws a figure when it is small (FrameAvatar::coarse), with the body; null: nobody.
  struct Coarse {
    std::shared_ptr<LoadedAvatar> avatar;
    std::shared_ptr<LoadedPackage> body;
  };
  // The last figure from now on, of whom the renderer knows nothing yet (add_to, add_figure_to).
  // kMismatch if the motion does not fit the body; nothing has changed then.
  Status add_figure(const Newcomer& newcomer);
  // From the next renderer on. kInvalidArgument if its body has other joints; nothing has changed
  // then.
  Status set_coarse(size_t figure, const Coarse& coarse);
  Coarse coarse(size_t figure) const {
    return {figures_[figure].coarse, figures_[figure].coarse_body};
  }
  // Those behind it move up. Their renderer is the caller's to tell.
  void remove_figure(size_t figure);
  void swap_figures(size_t a, size_t b);
  // As in a newcomer, of a figure that stays; null: the golden pose again.
  Status set_motion(size_t figure, const std::shared_ptr<LoadedPackage>& motion);
  // FrameAvatar::keep_to_known of every figure that is there now.
  void keep_to_known(bool keep);
  void set_place(size_t figure, const Placement& place) { figures_[figure].place = place; }

  size_t size() const { return figures_.size(); }
  bool moves() const { return frame_count_ > 1; }
  uint32_t frame_count() const { return frame_count_; }  // of the shortest motion; 1 without
  float frames_per_second() const { return frames_per_second_; }
  const LoadedAvatar& avatar(size_t figure) const { return *figures_[figure].avatar; }
  const LoadedPackage& body(size_t figure) const { return *figures_[figure].body; }
  // The frames of the range that exist. kInvalidArgument if it reaches beyond the motion.
  Result<std::vector<uint32_t>> frames(const FrameRange& range) const;

  // Adds every avatar, in the precision asked for or the best that it holds. Identities are kept in
  // order, one renderer at a time.
  Status add_to(Renderer& renderer, std::optional<Precision> precision);
  Status add_figure_to(Renderer& renderer, size_t figure, std::optional<Precision> precision);
  AvatarId id(size_t figure) const { return posed_[figure].avatar; }  // in the last renderer
  std::optional<AvatarId> coarse_id(size_t figure) const { return posed_[figure].coarse; }
  // What the avatars run in: "f32", "q8", or "mixed".
  std::string precision(const Renderer& renderer) const;
  // Whether every avatar holds it.
  bool holds(Precision precision) const;

  // Everybody's pose, at their places, in three ways; each valid until the next call of any, and
  // none allocates. In a frame of the motions, each by its own rate:
  std::span<const FrameAvatar> pose(uint32_t frame);
  // At a made-up moment of a scene without motion: swaying about the pose of frame 0.
  std::span<const FrameAvatar> sway(uint32_t moment);
  // At a time, from the figures' sources. Error: a source has ended.
  Result<std::span<const FrameAvatar>> pose_at(double time_s);
  // A figure's source for pose_at(); at first its motion, or its golden pose.
  void set_source(size_t figure, std::unique_ptr<PoseSource> source);

  // World position of a figure's joint in the last pose. Allocates.
  std::array<float, 3> joint_m(size_t figure, uint32_t joint) const;
  // The same of its root joint. Allocates nothing.
  std::array<float, 3> root_m(size_t figure) const;
  // Where a figure looks in the last pose, in degrees about the vertical: 0 is +z, positive towards
  // +x.
  float heading_deg(size_t figure) const;

 private:
  struct Figure {
    std::shared_ptr<LoadedAvatar> avatar, coarse;
    std::shared_ptr<LoadedPackage> body, coarse_body, motion;
    std::optional<StoredPose> pose;  // in place of a motion and of the golden pose
    Placement place;
    uint32_t ahead_frames = 0;         // of the scene
    std::vector<float> rest_joints_m;  // [J,3] of the template that the Gaussians sit on
    std::unique_ptr<PoseSource> source, swaying;
    std::vector<float> rotations;  // [J,4] of the last pose
    std::array<float, 3> root_translation_m{0, 0, 0};

    // Without motion the pose of a file or the golden one, whatever the frame.
    PoseView recorded_pose(uint32_t frame) const;
  };
  static Result<Figure> load_figure(const SceneOptions& options, size_t index,
                                    std::span<const Figure> others);
  static Status load_packages(const SceneOptions& options, size_t index,
                              std::span<const Figure> others, Figure& figure);
  static Status load_coarse(const SceneOptions& options, size_t index,
                            std::span<const Figure> others, Figure& figure);
  static Status check_coarse(const Figure& figure, const LoadedAvatar& coarse,
                             const LoadedPackage& body);
  void place_figure(size_t figure, const PoseView& pose);
  void find_length();

  std::vector<Figure> figures_;
  std::vector<FrameAvatar> posed_;
  uint32_t frame_count_ = 1;
  float frames_per_second_ = 30;
};

}  // namespace figurine::samples
