#include "ports/motion/retarget.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace figurine::ports {
namespace {

constexpr uint32_t kMaxFrames = 1u << 19;  // 460 MB
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMaxToeBendRad =
    35 * kDegree;  // the capture's toe markers swap now and then: toes do not bend further
constexpr double kContactReachM = 0.05;   // soles nearer to the floor than this are in contact
constexpr double kContactSmoothS = 0.10;  // standard deviation over time of the contact correction
constexpr double kContactQuantile =
    0.05;  // the ground is where the lowest soles are in the lowest twentieth of the frames

// The limb joints whose bone direction is aligned, and the joint at the bone's far end.
struct Bone {
  int joint, end;
};
constexpr std::array<Bone, 10> kLimbs = {{{kLeftHip, kLeftKnee},
                                          {kLeftKnee, kLeftAnkle},
                                          {kLeftShoulder, kLeftElbow},
                                          {kLeftElbow, kLeftWrist},
                                          {kLeftWrist, kLeftMiddle1},
                                          {kRightHip, kRightKnee},
                                          {kRightKnee, kRightAnkle},
                                          {kRightShoulder, kRightElbow},
                                          {kRightElbow, kRightWrist},
                                          {kRightWrist, kRightMiddle1}}};

// The joint at the far end of a bone that is aligned, or -1. The last phalanx has no joint beyond
// it: it goes with the one before.
int bone_end(int joint) {
  for (const Bone& limb : kLimbs) {
    if (limb.joint == joint) return limb.end;
  }
  return joint >= kLeftIndex1 && (joint - kLeftIndex1) % 3 != 2 ? joint + 1 : -1;
}

Vec3 bone(const figurine::Body& body, int from, int to) {
  return unit(joint_place(body, to) - joint_place(body, from));
}

// A of every joint: turns the body's rest into the source's neutral pose.
std::array<Quat, kJointCount> alignments(const figurine::Body& body, const RetargetSource& source) {
  std::array<Quat, kJointCount> align;
  std::array<bool, kJointCount>
      as_it_is{};  // limbs that start in the source's neutral direction keep their whole chain
  for (uint32_t j = 0; j < kJointCount; ++j) {
    const int parent = joint_parents()[j];
    // Fingers start from where the hand is; trunk, head and feet stand as they stand.
    const bool trunk = j <= kRightHip || j == kSpine1 || j == kSpine2 || j == kSpine3 ||
                       (j >= kNeck && j <= kHead) || (j >= kJaw && j <= kRightEye);
    align[j] = parent < 0 || trunk ? no_turn() : align[static_cast<size_t>(parent)];
    if (j == kLeftAnkle || j == kRightAnkle) {
      Vec3 own = bone(body, static_cast<int>(j), j == kLeftAnkle ? kLeftFoot : kRightFoot),
           wanted = source.direction[j];
      own.y = wanted.y = 0;  // about the vertical alone
      align[j] = length(wanted) > 1e-6 && length(own) > 1e-6 ? between(own, wanted) : no_turn();
    }
    if (parent >= 0) as_it_is[j] = as_it_is[static_cast<size_t>(parent)];
    const int end = bone_end(static_cast<int>(j));
    if (end < 0 || length(source.direction[j]) < 1e-6 || as_it_is[j]) continue;
    const Vec3 turned_bone = rotated(align[j], bone(body, static_cast<int>(j), end));
    const double angle =
        std::acos(std::clamp(dot(turned_bone, unit(source.direction[j])), -1.0, 1.0));
    as_it_is[j] = angle < source.tolerance_rad && (j == kLeftShoulder || j == kRightShoulder);
    if (!as_it_is[j]) align[j] = product(between(turned_bone, source.direction[j]), align[j]);
  }
  return align;
}

// How far each finger joint bends beyond the rest pose, and how far the fingers close, so that the
// hand looks at rest: local rotations.
std::array<Quat, kJointCount> relaxed_fingers(const figurine::Body& body) {
  std::array<Quat, kJointCount> curl;
  curl.fill(no_turn());
  constexpr double kFingerBend[3] = {25 * kDegree, 35 * kDegree, 24 * kDegree};
  constexpr double kSplayKept = 0.3;  // fingers of a template are spread for the skinner's sake
  for (int side = 0; side < 2; ++side) {
    const int shift = side * (kRightIndex1 - kLeftIndex1);
    const int wrist = kLeftWrist + side;
    const Vec3 along = bone(body, wrist, kLeftMiddle1 + shift);
    const Vec3 across = bone(body, kLeftPinky1 + shift, kLeftIndex1 + shift);
    const Vec3 palm =
        unit(side == 0 ? cross(along, across) : cross(across, along));  // out of the palm
    const Vec3 hinge = unit(cross(along, palm));  // turns `along` towards the palm
    for (int first : {kLeftIndex1, kLeftMiddle1, kLeftRing1, kLeftPinky1}) {
      Vec3 before = along;
      for (int i = 0; i < 2; ++i) {  // the last phalanx has no joint beyond it to measure
        const Vec3 own = bone(body, first + shift + i, first + shift + i + 1);
        const double bent = std::atan2(dot(cross(before, own), hinge), dot(before, own));
        curl[static_cast<size_t>(first + shift + i)] =
            about(hinge, std::clamp(kFingerBend[i] - bent, 0.0, kFingerBend[i]));
        before = own;
      }
      const Vec3 own = bone(body, first + shift, first + shift + 1);
      const double splay = std::atan2(dot(cross(along, own), palm), dot(along, own));
      curl[static_cast<size_t>(first + shift)] =
          product(curl[static_cast<size_t>(first + shift)], about(palm, (kSplayKept - 1) * splay));
      curl[static_cast<size_t>(first + shift + 2)] = about(hinge, 0.5 * kFingerBend[2]);
    }
  }
  return curl;
}

// Sole points: texels that hang on the ankle or ball of a foot more than on anything else.
struct Soles {
  std::vector<float> position_m, weights;
  std::vector<uint8_t> joints;
};

Soles soles_of(const figurine::Body& body) {
  Soles soles;
  for (size_t row = 0; row < body.texel.size(); ++row) {
    float foot = 0;
    for (size_t k = row * kSkinInfluences; k < (row + 1) * kSkinInfluences; ++k) {
      const uint8_t j = body.texel_joints[k];
      if (j == kLeftAnkle || j == kRightAnkle || j == kLeftFoot || j == kRightFoot)
        foot += body.texel_weights[k];
    }
    if (foot < 0.5f) continue;
    for (size_t i = 0; i < 3; ++i) soles.position_m.push_back(body.texel_position_m[3 * row + i]);
    for (size_t k = row * kSkinInfluences; k < (row + 1) * kSkinInfluences; ++k) {
      soles.joints.push_back(body.texel_joints[k]);
      soles.weights.push_back(body.texel_weights[k]);
    }
  }
  return soles;
}

// Height of the lowest sole point in every frame.
std::vector<float> sole_heights(const figurine::Body& body, const MotionClip& clip) {
  const Soles soles = soles_of(body);
  const figurine::Motion motion = clip.view();
  std::vector<float> heights(clip.frame_count, 0.0f);
  std::vector<Affine> transforms(kJointCount);
  for (uint32_t f = 0; f < clip.frame_count && !soles.position_m.empty(); ++f) {
    skinning_transforms(body.mean_skeleton(), motion.pose(f), transforms);
    float lowest = 1e30f;
    for (size_t i = 0; i < soles.position_m.size() / 3; ++i) {
      const Affine blended = blend(transforms, &soles.joints[i * kSkinInfluences],
                                   &soles.weights[i * kSkinInfluences]);
      lowest = std::min(lowest, transform_point(blended, &soles.position_m[3 * i])[1]);
    }
    heights[f] = lowest;
  }
  return heights;
}

// First the whole clip: the floor is where the lowest soles are. Then, slowly, frame by frame: a
// sole within reach of the floor is put on it, because the source's legs differ from the body's by
// centimetres (and from each other). Jumps and climbs are out of reach and stay as they are.
void ground(const figurine::Body& body, MotionClip& clip, RetargetReport& report) {
  std::vector<float> heights = sole_heights(body, clip);
  std::vector<float> sorted = heights;
  std::sort(sorted.begin(), sorted.end());
  const float floor =
      sorted[static_cast<size_t>(kContactQuantile * static_cast<double>(sorted.size() - 1))];
  for (float& height : heights) height -= floor;

  const double sigma = kContactSmoothS * double{clip.frames_per_second};
  const int radius = static_cast<int>(std::ceil(3 * sigma)),
            count = static_cast<int>(heights.size());
  std::vector<double> lift(heights.size());
  for (int f = 0; f < count; ++f) {
    double sum = 0,
           total =
               1e-3;  // the small constant fades the correction out where nothing touches the floor
    for (int i = std::max(0, f - radius); i <= std::min(count - 1, f + radius); ++i) {
      const double height = heights[static_cast<size_t>(i)];
      if (std::abs(height) > kContactReachM) continue;
      const double weight = std::exp(-0.5 * (i - f) * (i - f) / (sigma * sigma));
      sum += weight * height;
      total += weight;
    }
    lift[static_cast<size_t>(f)] = sum / total;
  }
  report.lowest_sole_m = 1e30f;
  float contact = 0;
  for (size_t f = 0; f < heights.size(); ++f) {
    clip.root_translation_m[3 * f + 1] -= floor + static_cast<float>(lift[f]);
    const float height = heights[f] - static_cast<float>(lift[f]);
    report.lowest_sole_m = std::min(report.lowest_sole_m, height);
    if (std::abs(heights[f]) > kContactReachM) continue;
    report.mean_contact_m += std::abs(height);
    ++contact;
  }
  if (contact > 0) report.mean_contact_m /= contact;
}

// The same rotation, by at most `limit`.
Quat limited(const Quat& rotation, double limit_rad) {
  const double angle = angle_between(rotation, no_turn());
  return angle > limit_rad ? slerped(no_turn(), limit_rad / angle, rotation) : rotation;
}

// Time resampled: source frame as a real number, clamped to its ends.
struct Sampler {
  uint32_t frames;
  uint32_t first(double t) const {
    return static_cast<uint32_t>(std::clamp(std::floor(t), 0.0, double(frames - 1)));
  }
  uint32_t second(double t) const { return std::min(first(t) + 1, frames - 1); }
  double share(double t) const { return std::clamp(t - std::floor(t), 0.0, 1.0); }
};

// Gaussian over neighbouring source frames. Quaternions are averaged linearly; signs are taken from
// the neighbour on the way to the middle, because a joint that spins is soon in the other
// hemisphere of the middle's.
void smooth(RetargetSource& source, double sigma_frames) {
  if (!(sigma_frames > 0.05)) return;
  const int radius = static_cast<int>(std::ceil(3 * sigma_frames));
  std::vector<double> window;
  for (int i = -radius; i <= radius; ++i)
    window.push_back(std::exp(-0.5 * i * i / (sigma_frames * sigma_frames)));
  const int last = static_cast<int>(source.frames) - 1;
  const std::vector<Vec3> hips = source.hips;
  // The window shrinks at the ends, so that neither end is pulled inward.
  const auto reach_at = [&](int f) { return std::min({radius, f, last - f}); };
  for (int f = 0; f <= last; ++f) {
    double total = 0;
    Vec3 place(0);
    for (int i = -reach_at(f); i <= reach_at(f); ++i) {
      const double w = window[static_cast<size_t>(i + radius)];
      total += w;
      place += w * hips[static_cast<size_t>(f + i)];
    }
    source.hips[static_cast<size_t>(f)] = place / total;
  }
  std::vector<Quat> rotations(source.frames);
  std::vector<bool> turned_over(source.frames);
  for (uint32_t j = 0; j < kJointCount; ++j) {
    if (!source.driven[j]) continue;
    const auto in_row = [&](int f) -> Quat& {
      return source.world_from_neutral[static_cast<size_t>(f) * kJointCount + j];
    };
    for (int f = 0; f <= last; ++f) {
      const size_t at = static_cast<size_t>(f);
      rotations[at] = in_row(f);
      turned_over[at] = f > 0 && dot(rotations[at], rotations[at - 1]) < 0;
      if (turned_over[at]) rotations[at] = negated(rotations[at]);
    }
    for (int f = 0; f <= last; ++f) {
      Quat sum(0, 0, 0, 0);
      double total = 0;
      for (int i = -reach_at(f); i <= reach_at(f); ++i) {
        const double w = window[static_cast<size_t>(i + radius)];
        sum = sum_of(1, sum, w, rotations[static_cast<size_t>(f + i)]);
        total += w;
      }
      // Several turns within the window leave nothing of the mean: the frame itself, then.
      if (!(dot(sum, sum) > 1e-6 * total * total)) continue;
      in_row(f) = turned_over[static_cast<size_t>(f)] ? negated(unit(sum)) : unit(sum);
    }
  }
}

// How many frames of the result lie within so many steps of the source, the first one included.
// Frame times are written with a few digits: a rate that is a multiple or a fraction of the
// result's to 5e-4 counts as that, and else a frame that is missed by as little, so that the last
// frame is not lost to the missing digits.
uint32_t frames_within(uint32_t source_steps, double step) {
  const double whole = step >= 1 ? std::round(step) : 1 / std::round(1 / step);
  if (std::abs(step / whole - 1) < 5e-4) step = whole;
  const double frames = source_steps / step;
  return static_cast<uint32_t>(frames + std::clamp(5e-4 * frames, 1e-6, 0.05)) + 1;
}

}  // namespace

const char* to_string(ClipUp up) {
  constexpr const char* kNames[] = {"y", "z", "x", "-y", "-z", "-x"};
  return kNames[static_cast<size_t>(up)];
}

std::optional<ClipUp> parse_up(std::string_view text) {
  for (const ClipUp up :
       {ClipUp::kY, ClipUp::kZ, ClipUp::kX, ClipUp::kMinusY, ClipUp::kMinusZ, ClipUp::kMinusX}) {
    if (text == to_string(up) || (text.starts_with('+') && text.substr(1) == to_string(up)))
      return up;
  }
  return std::nullopt;
}

Quat world_from_clip(ClipUp up) {
  constexpr double kRight = std::numbers::pi / 2;
  switch (up) {
    case ClipUp::kY:
      break;
    case ClipUp::kZ:
      return about(Vec3(1, 0, 0), -kRight);
    case ClipUp::kX:
      return about(Vec3(0, 0, 1), kRight);
    case ClipUp::kMinusY:
      return about(Vec3(1, 0, 0), 2 * kRight);
    case ClipUp::kMinusZ:
      return about(Vec3(1, 0, 0), kRight);
    case ClipUp::kMinusX:
      return about(Vec3(0, 0, 1), -kRight);
  }
  return no_turn();
}

Vec3 joint_place(const figurine::Body& body, int joint) {
  const float* p = &body.joint_position_m[3 * static_cast<size_t>(joint)];
  return {p[0], p[1], p[2]};
}

double leg_length_m(const figurine::Body& body) {
  const auto bone_length = [&](int from, int to) {
    return length(joint_place(body, to) - joint_place(body, from));
  };
  return 0.5 * (bone_length(kLeftHip, kLeftKnee) + bone_length(kLeftKnee, kLeftAnkle) +
                bone_length(kRightHip, kRightKnee) + bone_length(kRightKnee, kRightAnkle));
}

Status check_body(const figurine::Body& body) {
  if (body.joint_names != joint_names() ||
      !std::equal(body.parents.begin(), body.parents.end(), joint_parents().begin(),
                  joint_parents().end())) {
    return Status(StatusCode::kMismatch, "body: joints: not the 55 of SMPL-X");
  }
  return {};
}

Result<MotionClip> retarget(RetargetSource source, const figurine::Body& body,
                            const RetargetOptions& options, uint32_t start,
                            RetargetReport* report_out) {
  FIG_RETURN_IF_ERROR(check_body(body));
  const auto refused = [&](const std::string& reason) {
    return Status(StatusCode::kInvalidArgument, source.where + ": " + reason);
  };
  if (!(options.frames_per_second >= 1 && options.frames_per_second <= 240))
    return Status(StatusCode::kInvalidArgument, "fps: not within 1 and 240");
  if (start >= source.frames) {
    return refused("start " + std::to_string(start) + ": the clip has " +
                   std::to_string(source.frames) + " frames");
  }
  const double step = source.frames_per_second / options.frames_per_second;
  const uint32_t available = frames_within(source.frames - 1 - start, step);
  if (options.frames.value_or(1) == 0) return refused("frames: none asked for");
  if (options.frames.value_or(0) > available) {
    return refused("frames " + std::to_string(*options.frames) + ": only " +
                   std::to_string(available) + " from frame " + std::to_string(start) + " on at " +
                   std::to_string(options.frames_per_second) + " a second");
  }
  const uint32_t count = options.frames.value_or(available);
  if (count > kMaxFrames) return refused("more than 2^19 frames of the result");
  smooth(source, double{options.smooth_s.value_or(source.smooth_s)} * source.frames_per_second);

  const std::array<Quat, kJointCount> align = alignments(body, source);
  const std::array<Quat, kJointCount> curl = relaxed_fingers(body);
  const double leg = leg_length_m(body);
  RetargetReport report = report_out != nullptr ? *report_out : RetargetReport{};
  const double scale = leg / source.leg;
  report.scale = static_cast<float>(scale);
  const Vec3 root_rest = joint_place(body, kPelvis);
  const Vec3 hips_rest =
      0.5 * (joint_place(body, kLeftHip) + joint_place(body, kRightHip)) - root_rest;

  MotionClip clip;
  clip.name = options.name;
  clip.frames_per_second = options.frames_per_second;
  clip.frame_count = count;
  const Sampler sampler{source.frames};
  Vec3 origin = Vec3(0);  // the path starts over the body's rest place
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const double t = start + f * step;
    const size_t a = sampler.first(t), b = sampler.second(t);
    std::array<Quat, kJointCount> world;
    for (uint32_t j = 0; j < kJointCount; ++j) {
      const int parent = joint_parents()[j];
      Quat local = curl[j];
      if (source.driven[j]) {
        const Quat from_neutral =
            slerped(source.world_from_neutral[a * kJointCount + j], sampler.share(t),
                    source.world_from_neutral[b * kJointCount + j]);
        world[j] = product(from_neutral, align[j]);
        local =
            parent < 0 ? world[j] : product(reversed(world[static_cast<size_t>(parent)]), world[j]);
        if (j == kLeftFoot || j == kRightFoot) local = limited(local, kMaxToeBendRad);
      } else {
        world[j] = parent < 0 ? local : product(world[static_cast<size_t>(parent)], local);
      }
      for (double value : {local.w, local.x, local.y, local.z})
        clip.rotations.push_back(static_cast<float>(value));
    }
    const Vec3 hips =
        scale * ((1 - sampler.share(t)) * source.hips[a] + sampler.share(t) * source.hips[b]);
    Vec3 translation = hips - rotated(world[kPelvis], hips_rest) - root_rest;
    if (f == 0) origin = Vec3(translation.x, 0, translation.z);
    translation -= origin;
    for (int i = 0; i < 3; ++i)
      clip.root_translation_m.push_back(static_cast<float>(translation[i]));
  }
  make_continuous(clip.rotations, kJointCount);
  ground(body, clip, report);
  const size_t stride = size_t{kJointCount} * 4;
  for (size_t i = stride; i < clip.rotations.size(); i += 4) {
    double dot = 0;
    for (size_t k = 0; k < 4; ++k)
      dot += double{clip.rotations[i + k]} * clip.rotations[i + k - stride];
    report.largest_step_rad = std::max(
        report.largest_step_rad, static_cast<float>(2 * std::acos(std::min(1.0, std::abs(dot)))));
  }
  if (report_out != nullptr) *report_out = report;
  return clip;
}

}  // namespace figurine::ports
