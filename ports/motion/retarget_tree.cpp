#include "ports/motion/retarget_tree.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "ports/motion/bone_axes.h"
#include "ports/motion/standing.h"

namespace figurine::ports {
namespace {

// What a clip's frames hold, joint by joint, before anything is known of its neutral pose.
struct Frames {
  std::vector<Quat> rotation;     // [F,55] in the file's world; of the joints that are there
  std::vector<Quat> second_neck;  // [F], or empty
  std::vector<Vec3> hips;         // [F] middle of the hip joints
  Stance stance;
  BoneStretch stretch;
};

struct NeutralPose {
  Neutral which = Neutral::kFirstFrame;
  WorldPose pose;
  Quat upright = no_turn();  // stands it upright, facing +z
};

class TreeRetargeting {
 public:
  TreeRetargeting(ClipTree& tree, TreeKind kind, const figurine::Body& body,
                  const RetargetOptions& options)
      : tree_(tree), kind_(kind), body_(body), options_(options) {}

  Result<MotionClip> run(RetargetReport* report_out) {
    FIG_RETURN_IF_ERROR(check_body(body_));
    if (!kind_.is_gltf && options_.neutral == Neutral::kBoneAxes) {
      return Status(
          StatusCode::kInvalidArgument,
          tree_.where + ": neutral: a BVH has a first frame and a zero pose, no bone axes");
    }
    Result<JointNodes> joints = find_joints({.where = tree_.where,
                                             .names = tree_.names,
                                             .parents = tree_.parents,
                                             .moved = tree_.moved,
                                             .human_bones = tree_.human_bones},
                                            options_.map);
    if (!joints.ok()) return joints.status();
    joints_ = std::move(joints).value();
    for (uint32_t j = 0; j < kJointCount; ++j) known_[j] = joints_.has(static_cast<int>(j));
    FIG_RETURN_IF_ERROR(tree_.choose(joints_, options_));
    FIG_RETURN_IF_ERROR(read_frames());
    FIG_RETURN_IF_ERROR(find_neutral());
    return build(report_out);
  }

 private:
  Status refused(const std::string& reason) const {
    return Status(StatusCode::kUnsupported, tree_.where + ": " + reason);
  }

  JointPlaces places_of(const WorldPose& pose) const {
    JointPlaces places;
    places.fill(Vec3(0));
    for (uint32_t j = 0; j < kJointCount; ++j) {
      if (known_[j]) places[j] = pose.position[joints_.at(static_cast<int>(j))];
    }
    return places;
  }

  Status read_frames() {
    frames_.rotation.assign(size_t{tree_.frames} * kJointCount, no_turn());
    frames_.hips.reserve(tree_.frames);
    for (uint32_t f = 0; f < tree_.frames; ++f) {
      Result<WorldPose> pose = tree_.at(f);
      if (!pose.ok()) return pose.status();
      for (uint32_t j = 0; j < kJointCount; ++j) {
        if (known_[j])
          frames_.rotation[size_t{f} * kJointCount + j] =
              pose->rotation[joints_.at(static_cast<int>(j))];
      }
      if (joints_.second_neck >= 0)
        frames_.second_neck.push_back(pose->rotation[static_cast<size_t>(joints_.second_neck)]);
      const JointPlaces places = places_of(*pose);
      frames_.hips.push_back(0.5 * (places[kLeftHip] + places[kRightHip]));
      // A neutral frame may stand where the person never goes.
      if (f > 0 || tree_.frames == 1) frames_.stance.add(places);
      frames_.stretch.add(places);
      if (f == 0) first_ = std::move(pose).value();
    }
    Result<WorldPose> zero = tree_.zero_pose();
    if (!zero.ok()) return zero.status();
    zero_ = std::move(zero).value();
    return {};
  }

  // Legs as they are in a pose: bones do not change their length but where a file is broken.
  static double leg_of(const JointPlaces& places) {
    const auto distance = [&](int a, int b) {
      return length(places[static_cast<size_t>(a)] - places[static_cast<size_t>(b)]);
    };
    double leg = 0;
    for (int side = 0; side < 2; ++side) {
      leg += 0.5 * (distance(kLeftHip + side, kLeftKnee + side) +
                    distance(kLeftKnee + side, kLeftAnkle + side));
    }
    return leg;
  }

  // One candidate, and why it is no T-pose (empty: it is one).
  std::string try_neutral(Neutral which, const Quat& world_up, NeutralPose& out) const {
    out.which = which;
    out.pose = which == Neutral::kZeroPose ? zero_ : first_;
    const JointPlaces places = places_of(out.pose);
    // The zero pose need not stand as the motion does; the first frame is part of it.
    out.upright =
        which == Neutral::kZeroPose ? upright_by_itself(places) : facing_forward(places, world_up);
    return no_t_pose(places, known_, out.upright,
                     which == Neutral::kZeroPose ? kAPoseDrop : kTPoseDrop);
  }

  // How far the first frame's trunk or head is turned from the zero pose's, if that is too far for
  // a T-pose.
  std::string bent_back(const NeutralPose& first, const NeutralPose& zero) const {
    constexpr double kMostBend_rad = 8 * std::numbers::pi / 180;
    for (const int joint : {kPelvis, kSpine1, kSpine2, kSpine3, kNeck, kHead}) {
      if (!known_[static_cast<size_t>(joint)]) continue;
      const size_t node = joints_.at(joint);
      const double bend = angle_between(product(first.upright, first.pose.rotation[node]),
                                        product(zero.upright, zero.pose.rotation[node]));
      if (bend > kMostBend_rad) {
        return "its " + joint_names()[static_cast<size_t>(joint)] + " is turned by " +
               std::to_string(std::lround(bend * 180 / std::numbers::pi)) + " degrees";
      }
    }
    return "";
  }

  Status find_neutral() {
    // The up axis first: what the option says, or the format, or how the person stands.
    NeutralPose first, zero;
    const double leg = leg_of(places_of(first_));
    if (options_.up) {
      up_ = *options_.up;
    } else {
      const bool first_stands = try_neutral(Neutral::kFirstFrame, no_turn(), first).empty();
      const bool zero_stands = try_neutral(Neutral::kZeroPose, no_turn(), zero).empty() &&
                               angle_between(zero.upright, no_turn()) < 0.1;
      const std::optional<ClipUp> seen =
          first_stands ? std::nullopt : frames_.stance.other_up(ClipUp::kY, leg, zero_stands);
      up_ = seen.value_or(ClipUp::kY);
      up_is_seen_ = seen.has_value();
    }
    const Quat world_up = world_from_clip(up_);
    std::string first_defect = try_neutral(Neutral::kFirstFrame, world_up, first);
    const std::string zero_defect = try_neutral(Neutral::kZeroPose, world_up, zero);
    // Joints alone do not tell a back that is bent a little; a zero pose that is a template does.
    if (first_defect.empty() && zero_defect.empty()) first_defect = bent_back(first, zero);
    std::string axes_defect;
    if (kind_.is_gltf) axes_defect = not_the_known_rig(tree_, joints_, first_);
    if (options_.neutral == Neutral::kFrame) {
      if (options_.neutral_frame >= tree_.frames) {
        return Status(StatusCode::kInvalidArgument,
                      tree_.where + ": neutral: frame " + std::to_string(options_.neutral_frame) +
                          ": the clip has " + std::to_string(tree_.frames) + " frames");
      }
      Result<WorldPose> chosen = tree_.at(options_.neutral_frame);
      if (!chosen.ok()) return chosen.status();
      first_ = std::move(chosen).value();
      const std::string defect = try_neutral(Neutral::kFrame, world_up, neutral_);
      note_ = defect.empty() ? "" : "no T-pose: " + defect;
      return {};
    }
    const auto take = [&](NeutralPose& pose, const std::string& note) {
      neutral_ = std::move(pose);
      note_ = note;
      return Status();
    };
    NeutralPose axes = first;
    axes.which = Neutral::kBoneAxes;
    axes.upright = no_turn();
    if (options_.neutral) {
      const Neutral wanted = *options_.neutral;
      if (wanted == Neutral::kBoneAxes) {
        if (!axes_defect.empty()) {
          return refused(axes_defect +
                         ", as in the known rig; a file with a T-pose is read with "
                         "--neutral zero or first");
        }
        return take(axes, "");
      }
      const std::string& defect = wanted == Neutral::kZeroPose ? zero_defect : first_defect;
      // The option is obeyed; only what the pose says of its heading is doubted.
      NeutralPose& chosen = wanted == Neutral::kZeroPose ? zero : first;
      return take(chosen, defect.empty() ? "" : "no T-pose: " + defect);
    }
    if (!kind_.is_gltf) {
      if (first_defect.empty()) return take(first, "");
      if (zero_defect.empty()) return take(zero, "the first frame is none: " + first_defect);
      return refused("no T-pose: of the first frame " + first_defect + ", of the zero pose " +
                     zero_defect + "; --neutral first, zero or a frame takes one as it is");
    }
    if (!tree_.human_bones.empty() && options_.map.empty())
      return take(zero, zero_defect.empty() ? "" : "no T-pose: " + zero_defect);
    if (axes_defect.empty()) return take(axes, "");
    if (zero_defect.empty()) return take(zero, "");
    if (first_defect.empty()) return take(first, "");
    return refused("no T-pose: of the nodes " + zero_defect + ", of the first frame " +
                   first_defect + ", and by the bones' axes " + axes_defect +
                   "; --neutral zero, first or a frame takes one as it is");
  }

  // R(neutral)^T of a joint, once its pose stands upright.
  Quat neutral_from_world(const Quat& rotation) const {
    return reversed(neutral_.upright == no_turn() ? rotation : product(neutral_.upright, rotation));
  }

  void set_directions(RetargetSource& source, const JointPlaces& places) const {
    for (int joint = 0; joint < static_cast<int>(kJointCount); ++joint) {
      const int end = bone_end_of(joint);
      if (end < 0 || !known_[static_cast<size_t>(joint)]) continue;
      Vec3& direction = source.direction[static_cast<size_t>(joint)];
      const Vec3 own = places[static_cast<size_t>(end)] - places[static_cast<size_t>(joint)];
      if (neutral_.which == Neutral::kBoneAxes) {
        direction = rotated(*neutral_axes(joint), Vec3(0, 1, 0));
      } else if (known_[static_cast<size_t>(end)] && length(own) > 1e-6) {
        direction = unit(own);
        if (neutral_.upright != no_turn()) direction = rotated(neutral_.upright, direction);
      } else if (joint == kLeftWrist || joint == kRightWrist) {
        direction = source.direction[static_cast<size_t>(joint - 2)];  // goes on as the forearm
      }
    }
  }

  Result<MotionClip> build(RetargetReport* report_out) {
    const Quat world_up = world_from_clip(up_);
    const bool turns = up_ != ClipUp::kY;
    const JointPlaces places = places_of(neutral_.pose);
    RetargetSource source;
    source.where = tree_.where;
    source.frames_per_second = tree_.frames_per_second;
    source.frames = tree_.frames;
    source.smooth_s = kind_.is_gltf ? 0 : kCaptureSmoothS;
    source.leg = leg_of(places);
    if (!(source.leg > 1e-6)) return refused("legs of no length");
    set_directions(source, places);
    source.hips = std::move(frames_.hips);
    if (turns) {
      for (Vec3& place : source.hips) place = rotated(world_up, place);
    }

    source.world_from_neutral = std::move(frames_.rotation);
    for (uint32_t j = 0; j < kJointCount; ++j) {
      if (!known_[j]) continue;
      const bool by_axes = neutral_.which == Neutral::kBoneAxes;
      const std::optional<Quat> axes = neutral_axes(static_cast<int>(j));
      if (by_axes && !axes) continue;
      // A middle finger without a second joint tells a direction, and no more.
      if (j >= kLeftIndex1 && (j - kLeftIndex1) % 3 == 0 && !known_[j + 1]) continue;
      source.driven[j] = true;
      const auto from_world = [&](size_t node) {
        return by_axes ? reversed(*axes) : neutral_from_world(neutral_.pose.rotation[node]);
      };
      const Quat own = from_world(joints_.at(static_cast<int>(j)));
      const bool two = j == kNeck && !frames_.second_neck.empty();
      const Quat second = two ? from_world(static_cast<size_t>(joints_.second_neck)) : no_turn();
      for (uint32_t f = 0; f < tree_.frames; ++f) {
        Quat& q = source.world_from_neutral[size_t{f} * kJointCount + j];
        q = product(q, own);
        // The neck of the body spans two of the source's and follows their mean.
        if (two) q = slerped(q, 0.5, product(frames_.second_neck[f], second));
        if (turns) q = product(world_up, q);
      }
    }
    // The neutral frame is no motion: it must not leak into its neighbours when they are smoothed.
    const bool skip_first = neutral_.which == Neutral::kFirstFrame && source.frames > 1;
    if (skip_first) {
      source.hips[0] = source.hips[1];
      std::copy_n(source.world_from_neutral.begin() + kJointCount, kJointCount,
                  source.world_from_neutral.begin());
    }

    const double scale = leg_length_m(body_) / source.leg;
    const BoneRatios ratios = bone_ratios(places, scale, body_);
    if (options_.checked) {
      const double seconds = tree_.frames / tree_.frames_per_second;
      for (const std::string& defect :
           {frames_.stance.lies(world_up, source.leg), ratios.unsound(), frames_.stretch.unsound(),
            frames_.stance.too_fast(scale, seconds)}) {
        if (!defect.empty()) return refused(defect + "; --no-checks writes it all the same");
      }
    }
    RetargetReport report;
    const std::string summary = summary_of(places, scale, ratios);
    Result<MotionClip> clip = retarget(std::move(source), body_, options_,
                                       options_.start.value_or(skip_first ? 1 : 0), &report);
    report.summary = summary;
    report.animation = tree_.animation;
    if (clip.ok() && report_out != nullptr) *report_out = report;
    return clip;
  }

  std::string summary_of(const JointPlaces& places, double scale, const BoneRatios& ratios) const {
    char text[160];
    std::snprintf(text, sizeof text, "%u frames at %.5g a second", tree_.frames,
                  tree_.frames_per_second);
    std::string out = text;
    out += std::string(", up ") + to_string(up_) + (up_is_seen_ ? " (as the person stands)" : "");
    const std::string frame = "frame " + std::to_string(options_.neutral_frame);
    const std::string neutrals[] = {"the first frame", "the zero pose", frame, "the bone axes"};
    out += ", T-pose from " + neutrals[static_cast<size_t>(neutral_.which)];
    if (!note_.empty()) out += " (" + note_ + ")";
    out += ", names of " + joints_.naming;
    if (known_[kHead]) {
      const auto height = [](const Vec3& head, const Vec3& left, const Vec3& right) {
        return head.y - std::min(left.y, right.y);
      };
      const auto place = [&](int joint) {
        return rotated(neutral_.upright, places[static_cast<size_t>(joint)]);
      };
      std::snprintf(text, sizeof text,
                    ", head %.2f m above the ankles (%.4g in the file, body %.2f m)",
                    scale * height(place(kHead), place(kLeftAnkle), place(kRightAnkle)),
                    height(place(kHead), place(kLeftAnkle), place(kRightAnkle)),
                    height(joint_place(body_, kHead), joint_place(body_, kLeftAnkle),
                           joint_place(body_, kRightAnkle)));
      out += text;
    }
    out += ", " + ratios.text();
    for (const std::string& note : {tree_.note, joints_.note}) {
      if (!note.empty()) out += "; " + note;
    }
    return out;
  }

  ClipTree& tree_;
  TreeKind kind_;
  const figurine::Body& body_;
  const RetargetOptions& options_;
  JointNodes joints_;
  std::array<bool, kJointCount> known_{};
  Frames frames_;
  WorldPose first_, zero_;
  NeutralPose neutral_;
  std::string note_;
  ClipUp up_ = ClipUp::kY;
  bool up_is_seen_ = false;
};

}  // namespace

Result<MotionClip> retarget_tree(ClipTree& tree, TreeKind kind, const figurine::Body& body,
                                 const RetargetOptions& options, RetargetReport* report) {
  return TreeRetargeting(tree, kind, body, options).run(report);
}

}  // namespace figurine::ports
