#include "toolchain/body/retarget.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "toolchain/body/npz.h"
#include "toolchain/body/retarget_source.h"
#include "toolchain/body/surface.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

using Quat = Eigen::Quaterniond;
using Vec3 = Eigen::Vector3d;

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

Vec3 joint_at(const figurine::Body& body, int j) {
  return {body.joint_position_m[3 * static_cast<size_t>(j)],
          body.joint_position_m[3 * static_cast<size_t>(j) + 1],
          body.joint_position_m[3 * static_cast<size_t>(j) + 2]};
}

Vec3 bone(const figurine::Body& body, int from, int to) {
  return (joint_at(body, to) - joint_at(body, from)).normalized();
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
    align[j] = parent < 0 || trunk ? Quat::Identity() : align[static_cast<size_t>(parent)];
    if (j == kLeftAnkle || j == kRightAnkle) {
      Vec3 own = bone(body, static_cast<int>(j), j == kLeftAnkle ? kLeftFoot : kRightFoot),
           wanted = source.direction[j];
      own.y() = wanted.y() = 0;  // about the vertical alone
      align[j] = wanted.norm() > 1e-6 && own.norm() > 1e-6 ? Quat::FromTwoVectors(own, wanted)
                                                           : Quat::Identity();
    }
    if (parent >= 0) as_it_is[j] = as_it_is[static_cast<size_t>(parent)];
    const int end = bone_end(static_cast<int>(j));
    if (end < 0 || source.direction[j].norm() < 1e-6 || as_it_is[j]) continue;
    const Vec3 turned_bone = align[j] * bone(body, static_cast<int>(j), end);
    const double angle =
        std::acos(std::clamp(turned_bone.dot(source.direction[j].normalized()), -1.0, 1.0));
    as_it_is[j] = angle < source.tolerance_rad && (j == kLeftShoulder || j == kRightShoulder);
    if (!as_it_is[j]) align[j] = Quat::FromTwoVectors(turned_bone, source.direction[j]) * align[j];
  }
  return align;
}

// How far each finger joint bends beyond the rest pose, and how far the fingers close, so that the
// hand looks at rest: local rotations.
std::array<Quat, kJointCount> relaxed_fingers(const figurine::Body& body) {
  std::array<Quat, kJointCount> curl;
  curl.fill(Quat::Identity());
  constexpr double kFingerBend[3] = {25 * kDegree, 35 * kDegree, 24 * kDegree};
  constexpr double kSplayKept = 0.3;  // fingers of a template are spread for the skinner's sake
  for (int side = 0; side < 2; ++side) {
    const int shift = side * (kRightIndex1 - kLeftIndex1);
    const int wrist = kLeftWrist + side;
    const Vec3 along = bone(body, wrist, kLeftMiddle1 + shift);
    const Vec3 across = bone(body, kLeftPinky1 + shift, kLeftIndex1 + shift);
    const Vec3 palm =
        (side == 0 ? along.cross(across) : across.cross(along)).normalized();  // out of the palm
    const Vec3 hinge = along.cross(palm).normalized();  // turns `along` towards the palm
    for (int first : {kLeftIndex1, kLeftMiddle1, kLeftRing1, kLeftPinky1}) {
      Vec3 before = along;
      for (int i = 0; i < 2; ++i) {  // the last phalanx has no joint beyond it to measure
        const Vec3 own = bone(body, first + shift + i, first + shift + i + 1);
        const double bent = std::atan2(before.cross(own).dot(hinge), before.dot(own));
        curl[static_cast<size_t>(first + shift + i)] =
            Quat(Eigen::AngleAxisd(std::clamp(kFingerBend[i] - bent, 0.0, kFingerBend[i]), hinge));
        before = own;
      }
      const Vec3 own = bone(body, first + shift, first + shift + 1);
      const double splay = std::atan2(along.cross(own).dot(palm), along.dot(own));
      curl[static_cast<size_t>(first + shift)] =
          curl[static_cast<size_t>(first + shift)] *
          Quat(Eigen::AngleAxisd((kSplayKept - 1) * splay, palm));
      curl[static_cast<size_t>(first + shift + 2)] =
          Quat(Eigen::AngleAxisd(0.5 * kFingerBend[2], hinge));
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
    const std::vector<float> posed =
        skin_positions(soles.position_m, soles.joints, soles.weights, transforms);
    heights[f] = posed[1];
    for (size_t i = 1; i < posed.size(); i += 3) heights[f] = std::min(heights[f], posed[i]);
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
  const double angle = rotation.angularDistance(Quat::Identity());
  return angle > limit_rad ? Quat::Identity().slerp(limit_rad / angle, rotation) : rotation;
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

// Gaussian over neighbouring source frames. Quaternions are averaged linearly in one hemisphere:
// neighbours differ by a few degrees.
void smooth(RetargetSource& source, double sigma_frames) {
  if (!(sigma_frames > 0.05)) return;
  const int radius = static_cast<int>(std::ceil(3 * sigma_frames));
  std::vector<double> window;
  for (int i = -radius; i <= radius; ++i)
    window.push_back(std::exp(-0.5 * i * i / (sigma_frames * sigma_frames)));
  const std::vector<Quat> rotations = source.world_from_neutral;
  const std::vector<Vec3> hips = source.hips;
  const int last = static_cast<int>(source.frames) - 1;
  for (int f = 0; f <= last; ++f) {
    // The window shrinks at the ends, so that neither end is pulled inward.
    const int reach = std::min({radius, f, last - f});
    double total = 0;
    Vec3 place = Vec3::Zero();
    for (int i = -reach; i <= reach; ++i) {
      const double w = window[static_cast<size_t>(i + radius)];
      total += w;
      place += w * hips[static_cast<size_t>(f + i)];
    }
    source.hips[static_cast<size_t>(f)] = place / total;
    for (uint32_t j = 0; j < kJointCount; ++j) {
      const Quat& centre = rotations[static_cast<size_t>(f) * kJointCount + j];
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (int i = -reach; i <= reach; ++i) {
        const Quat& q = rotations[static_cast<size_t>(f + i) * kJointCount + j];
        sum +=
            (q.dot(centre) < 0 ? -1.0 : 1.0) * window[static_cast<size_t>(i + radius)] * q.coeffs();
      }
      source.world_from_neutral[static_cast<size_t>(f) * kJointCount + j] = Quat(sum.normalized());
    }
  }
}

}  // namespace

MotionClip retarget(RetargetSource source, const figurine::Body& body,
                    const RetargetOptions& options, uint32_t start, RetargetReport* report_out) {
  if (body.joint_count() != kJointCount) throw InputError("body: joints: not the 55 of SMPL-X");
  if (!(options.frames_per_second >= 1 && options.frames_per_second <= 240))
    throw InputError("fps: not within 1 and 240");
  if (start >= source.frames) {
    throw InputError(source.where + ": start " + std::to_string(start) + ": the clip has " +
                     std::to_string(source.frames) + " frames");
  }
  const double step = source.frames_per_second / options.frames_per_second;
  const uint32_t available = static_cast<uint32_t>((source.frames - 1 - start) / step + 1e-6) + 1;
  if (options.frames.value_or(1) == 0) throw InputError("frames: none asked for");
  if (options.frames.value_or(0) > available) {
    throw InputError(source.where + ": frames " + std::to_string(*options.frames) + ": only " +
                     std::to_string(available) + " from frame " + std::to_string(start) +
                     " on at " + std::to_string(options.frames_per_second) + " a second");
  }
  smooth(source, double{options.smooth_s.value_or(source.smooth_s)} * source.frames_per_second);

  const std::array<Quat, kJointCount> align = alignments(body, source);
  const std::array<Quat, kJointCount> curl = relaxed_fingers(body);
  const double leg = 0.5 * ((joint_at(body, kLeftKnee) - joint_at(body, kLeftHip)).norm() +
                            (joint_at(body, kLeftAnkle) - joint_at(body, kLeftKnee)).norm() +
                            (joint_at(body, kRightKnee) - joint_at(body, kRightHip)).norm() +
                            (joint_at(body, kRightAnkle) - joint_at(body, kRightKnee)).norm());
  RetargetReport report;
  const double scale = leg / source.leg;
  report.scale = static_cast<float>(scale);
  const Vec3 root_rest = joint_at(body, kPelvis);
  const Vec3 hips_rest = 0.5 * (joint_at(body, kLeftHip) + joint_at(body, kRightHip)) - root_rest;

  MotionClip clip;
  clip.name = options.name;
  clip.frames_per_second = options.frames_per_second;
  clip.frame_count = options.frames.value_or(available);
  const Sampler sampler{source.frames};
  Vec3 origin = Vec3::Zero();  // the path starts over the body's rest place
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const double t = start + f * step;
    const size_t a = sampler.first(t), b = sampler.second(t);
    std::array<Quat, kJointCount> world;
    for (uint32_t j = 0; j < kJointCount; ++j) {
      const int parent = joint_parents()[j];
      Quat local = curl[j];
      if (source.driven[j]) {
        const Quat from_neutral = source.world_from_neutral[a * kJointCount + j].slerp(
            sampler.share(t), source.world_from_neutral[b * kJointCount + j]);
        world[j] = from_neutral * align[j];
        local = parent < 0 ? world[j] : world[static_cast<size_t>(parent)].conjugate() * world[j];
        if (j == kLeftFoot || j == kRightFoot) local = limited(local, kMaxToeBendRad);
      } else {
        world[j] = parent < 0 ? local : world[static_cast<size_t>(parent)] * local;
      }
      for (double value : {local.w(), local.x(), local.y(), local.z()})
        clip.rotations.push_back(static_cast<float>(value));
    }
    const Vec3 hips =
        scale * ((1 - sampler.share(t)) * source.hips[a] + sampler.share(t) * source.hips[b]);
    Vec3 translation = hips - world[kPelvis] * hips_rest - root_rest;
    if (f == 0) origin = Vec3(translation.x(), 0, translation.z());
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

namespace {

// CMU's names. The neck of the body spans two source segments and follows their mean.
struct Driver {
  int joint;
  const char* name;
  const char* second;  // averaged with it, or nullptr
};
constexpr std::array<Driver, 20> kCmu = {{{kPelvis, "Hips", nullptr},
                                          {kLeftHip, "LeftUpLeg", nullptr},
                                          {kRightHip, "RightUpLeg", nullptr},
                                          {kSpine1, "LowerBack", nullptr},
                                          {kLeftKnee, "LeftLeg", nullptr},
                                          {kRightKnee, "RightLeg", nullptr},
                                          {kSpine2, "Spine", nullptr},
                                          {kLeftAnkle, "LeftFoot", nullptr},
                                          {kRightAnkle, "RightFoot", nullptr},
                                          {kSpine3, "Spine1", nullptr},
                                          {kLeftFoot, "LeftToeBase", nullptr},
                                          {kRightFoot, "RightToeBase", nullptr},
                                          {kNeck, "Neck", "Neck1"},
                                          {kHead, "Head", nullptr},
                                          {kLeftShoulder, "LeftArm", nullptr},
                                          {kRightShoulder, "RightArm", nullptr},
                                          {kLeftElbow, "LeftForeArm", nullptr},
                                          {kRightElbow, "RightForeArm", nullptr},
                                          {kLeftWrist, "LeftHand", nullptr},
                                          {kRightWrist, "RightHand", nullptr}}};
constexpr std::array<Driver, 2> kCmuCollars = {
    {{kLeftCollar, "LeftShoulder", nullptr}, {kRightCollar, "RightShoulder", nullptr}}};

struct BvhPose {
  std::vector<Quat> rotation;  // world
  std::vector<Vec3> position;
};

// World transforms of one frame; values == nullptr: the hierarchy's own zero pose.
BvhPose bvh_pose(const Bvh& bvh, const float* values) {
  BvhPose pose{std::vector<Quat>(bvh.joints.size()), std::vector<Vec3>(bvh.joints.size())};
  for (size_t j = 0; j < bvh.joints.size(); ++j) {
    const BvhJoint& joint = bvh.joints[j];
    Vec3 offset(joint.offset[0], joint.offset[1], joint.offset[2]);
    Quat rotation = Quat::Identity();
    for (size_t c = 0; values != nullptr && c < joint.channels.size(); ++c) {
      const double value = values[joint.first_channel + c];
      const int axis = static_cast<int>(joint.channels[c]) % 3;
      // Positions replace the root's offset and add to any other joint's.
      if (joint.channels[c] <= BvhChannel::kZPosition) {
        offset[axis] = joint.parent < 0 ? value : offset[axis] + value;
      } else {
        rotation = rotation * Quat(Eigen::AngleAxisd(value * kDegree, Vec3::Unit(axis)));
      }
    }
    const size_t parent = static_cast<size_t>(joint.parent);
    pose.rotation[j] = joint.parent < 0 ? rotation : pose.rotation[parent] * rotation;
    pose.position[j] =
        joint.parent < 0 ? offset : pose.position[parent] + pose.rotation[parent] * offset;
  }
  return pose;
}

size_t joint_index(const Bvh& bvh, const char* name, const std::string& where) {
  const int index = bvh.find(name);
  if (index < 0)
    throw InputError(where + ": HIERARCHY: no joint " + name +
                     " (the names of the CMU conversions are understood)");
  return static_cast<size_t>(index);
}

}  // namespace

MotionClip retarget_bvh(const Bvh& bvh, const figurine::Body& body, const RetargetOptions& options,
                        RetargetReport* report) {
  const std::string& where = bvh.where;
  const Neutral neutral_of = options.neutral.value_or(Neutral::kFirstFrame);
  if (neutral_of == Neutral::kBoneAxes)
    throw InputError(where + ": neutral: a BVH has a first frame and a zero pose, no bone axes");
  RetargetSource source;
  source.where = where;
  source.frames_per_second = 1 / bvh.frame_time_s;
  source.smooth_s = kCaptureSmoothS;
  source.frames = bvh.frame_count;
  std::vector<Driver> drivers(kCmu.begin(), kCmu.end());
  drivers.insert(drivers.end(), kCmuCollars.begin(), kCmuCollars.end());
  std::vector<std::pair<size_t, size_t>> index;
  for (const Driver& driver : drivers) {
    const size_t first = joint_index(bvh, driver.name, where);
    index.emplace_back(first,
                       driver.second == nullptr ? first : joint_index(bvh, driver.second, where));
    source.driven[static_cast<size_t>(driver.joint)] = true;
  }
  const auto at = [&](const char* name) { return joint_index(bvh, name, where); };

  const BvhPose neutral =
      bvh_pose(bvh, neutral_of == Neutral::kFirstFrame ? bvh.values.data() : nullptr);
  const auto direction = [&](const char* from, const char* to) -> Vec3 {
    return (neutral.position[at(to)] - neutral.position[at(from)]).normalized();
  };
  for (int side = 0; side < 2; ++side) {
    const std::string s = side == 0 ? "Left" : "Right";
    const auto joined = [&](const char* from, const char* to) {
      return direction((s + from).c_str(), (s + to).c_str());
    };
    source.direction[static_cast<size_t>(kLeftHip + side)] = joined("UpLeg", "Leg");
    source.direction[static_cast<size_t>(kLeftKnee + side)] = joined("Leg", "Foot");
    source.direction[static_cast<size_t>(kLeftAnkle + side)] = joined("Foot", "ToeBase");
    source.direction[static_cast<size_t>(kLeftShoulder + side)] = joined("Arm", "ForeArm");
    source.direction[static_cast<size_t>(kLeftElbow + side)] = joined("ForeArm", "Hand");
    source.direction[static_cast<size_t>(kLeftWrist + side)] =
        joined("ForeArm", "Hand");  // the hand continues the forearm
    source.leg +=
        0.5 *
        ((neutral.position[at((s + "Leg").c_str())] - neutral.position[at((s + "UpLeg").c_str())])
             .norm() +
         (neutral.position[at((s + "Foot").c_str())] - neutral.position[at((s + "Leg").c_str())])
             .norm());
  }
  if (!(source.leg > 1e-6)) throw InputError(where + ": HIERARCHY: legs of no length");

  source.world_from_neutral.assign(size_t{source.frames} * kJointCount, Quat::Identity());
  const size_t left_hip = at("LeftUpLeg"), right_hip = at("RightUpLeg");
  for (uint32_t f = 0; f < source.frames; ++f) {
    const BvhPose pose = bvh_pose(bvh, &bvh.values[size_t{f} * bvh.channel_count]);
    source.hips.push_back(0.5 * (pose.position[left_hip] + pose.position[right_hip]));
    for (size_t d = 0; d < drivers.size(); ++d) {
      const auto [first, second] = index[d];
      const Quat a = pose.rotation[first] * neutral.rotation[first].conjugate();
      const Quat b = pose.rotation[second] * neutral.rotation[second].conjugate();
      source.world_from_neutral[size_t{f} * kJointCount + static_cast<size_t>(drivers[d].joint)] =
          first == second ? a : a.slerp(0.5, b);
    }
  }
  const uint32_t start =
      options.start.value_or(neutral_of == Neutral::kFirstFrame && source.frames > 1 ? 1 : 0);
  // The neutral frame is no motion: it must not leak into its neighbours when they are smoothed.
  if (neutral_of == Neutral::kFirstFrame && source.frames > 1) {
    source.hips[0] = source.hips[1];
    std::copy_n(source.world_from_neutral.begin() + kJointCount, kJointCount,
                source.world_from_neutral.begin());
  }
  return retarget(std::move(source), body, options, start, report);
}

MotionClip retarget_npz(const std::string& path, const figurine::Body& body,
                        const RetargetOptions& options, RetargetReport* report) {
  const NpzFile file = NpzFile::open(path);
  const NpyArray poses = file.read("poses", {0, 0});
  const NpyArray trans = file.read("trans", {poses.shape[0], 3});
  const char* rate_key = file.has("mocap_frame_rate") ? "mocap_frame_rate" : "mocap_framerate";
  const NpyArray rate = file.read(rate_key);
  const size_t columns = poses.shape[1], driven = columns / 3;
  if (poses.shape[0] == 0 || poses.shape[0] > (1u << 24))
    throw InputError(path + ": poses: no or too many frames");
  if (columns != 165 && columns != 156 && columns != 66) {
    throw InputError(path + ": poses: " + std::to_string(columns) +
                     " columns, expected 165 (SMPL-X), 156 (SMPL-H) or 66 (body)");
  }
  if (rate.values.size() != 1 || !(rate.values[0] >= 1 && rate.values[0] <= 1000))
    throw InputError(path + ": " + rate_key + ": not within 1 and 1000");
  for (const NpyArray* array : {&poses, &trans}) {
    for (double value : array->values) {
      if (!(std::abs(value) <= 1e4))
        throw InputError(path + (array == &poses ? ": poses" : ": trans") +
                         ": a value is not finite or out of range");
    }
  }
  RetargetSource source;
  source.where = path;
  source.frames_per_second = rate.values[0];
  source.smooth_s = kCaptureSmoothS;
  source.frames = static_cast<uint32_t>(poses.shape[0]);
  // SMPL-X's template: arms along x, legs of 0.79 m. Bodies that stand in that pose themselves are
  // within the tolerance.
  source.leg = 0.79;
  source.tolerance_rad = 20 * kDegree;
  for (int side = 0; side < 2; ++side) {
    for (int joint : {kLeftShoulder, kLeftElbow, kLeftWrist})
      source.direction[static_cast<size_t>(joint + side)] = Vec3(side == 0 ? 1 : -1, 0, 0);
  }
  // SMPL-H has no jaw and eyes: its 30 hand joints follow the body directly.
  std::vector<uint32_t> joint_of_column;
  for (uint32_t j = 0; j < kJointCount && joint_of_column.size() < driven; ++j) {
    if (columns == 156 && j >= kJaw && j <= kRightEye) continue;
    joint_of_column.push_back(j);
    source.driven[j] = true;
  }
  const Quat up = options.z_up ? Quat(Eigen::AngleAxisd(-std::numbers::pi / 2, Vec3::UnitX()))
                               : Quat::Identity();
  source.world_from_neutral.assign(size_t{source.frames} * kJointCount, Quat::Identity());
  for (uint32_t f = 0; f < source.frames; ++f) {
    Quat* world = &source.world_from_neutral[size_t{f} * kJointCount];
    for (size_t column = 0; column < joint_of_column.size(); ++column) {
      const uint32_t j = joint_of_column[column];
      const double* value = &poses.values[f * columns + 3 * column];
      const Vec3 axis_angle(value[0], value[1], value[2]);
      const double angle = axis_angle.norm();
      const Quat local =
          angle > 1e-12 ? Quat(Eigen::AngleAxisd(angle, axis_angle / angle)) : Quat::Identity();
      world[j] = (j == 0 ? up : world[joint_parents()[j]]) * local;
    }
    // trans moves the pelvis; the middle of the hips lies 9 cm below it in SMPL-X's template.
    source.hips.push_back(
        up * Vec3(trans.values[3 * f], trans.values[3 * f + 1], trans.values[3 * f + 2]) +
        world[kPelvis] * Vec3(0, -0.09, 0));
  }
  return retarget(std::move(source), body, options, options.start.value_or(0), report);
}

}  // namespace figurine::body
