// glTF skeletons in terms of the 55 joints.
//
// Joints are found by name, in the naming that Autodesk's HumanIK brought up and Mixamo spread
// ("LeftUpLeg", "RightHandIndex1"), behind any prefix up to a colon ("mixamorig:") or "Avatar_".
// The table was read from the 62 joints of the emotes in the npm package
// @dcl/wearable-preview 1.28.1 (Decentraland, Apache-2.0), the only rig whose bone axes are known
// here.
//
// Those files hold no rest pose: their nodes and, where there is a skin, its inverse bind matrices
// stand in a frame of the animation. What they do fix is where the axes of every joint lie in its
// bone, measured over all 16 clips: y runs along the bone (the next joint lies there in every
// frame), elbows turn about x only one way, knees too, fingers close about z from 0 to 94 degrees
// and hardly open beyond. That is a T-pose told by its axes: neutral_axes() below. A foot at rest
// on the floor points 26 degrees down, from ankle to ball (the idle, dance and jump clips).
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "toolchain/body/gltf.h"
#include "toolchain/body/retarget.h"
#include "toolchain/body/retarget_source.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

using Quat = Eigen::Quaterniond;
using Vec3 = Eigen::Vector3d;

constexpr double kMaxFrames = 1 << 18;  // 55 rotations each: 460 MB
constexpr double kMaxPlace = 1e9;       // of a joint, in the file's unit
constexpr double kMaxBoneAngleRad =
    0.35;  // from a joint's y axis to the next joint, if the rig is the known one
constexpr double kFootPitchRad = 26 * std::numbers::pi / 180;

// Where a joint's axes lie in the T-pose: a person upright who faces +z, arms along x, palms down.
enum class Axes : uint8_t { kTrunk, kLeg, kFoot, kToes, kLeftArm, kRightArm };

Quat neutral_axes(Axes axes) {
  Vec3 x = Vec3::UnitX(), y = Vec3::UnitY();  // the trunk's
  if (axes == Axes::kLeg) x = -x, y = -y;     // the hips' too
  if (axes == Axes::kFoot) y = Vec3(0, -std::sin(kFootPitchRad), std::cos(kFootPitchRad));
  if (axes == Axes::kToes) y = Vec3::UnitZ();
  if (axes == Axes::kLeftArm) x = Vec3::UnitY(), y = Vec3::UnitX();
  if (axes == Axes::kRightArm) x = Vec3::UnitY(), y = -Vec3::UnitX();
  Eigen::Matrix3d world;
  world << x, y, x.cross(y);
  return Quat(world);
}

struct Driver {
  int joint;
  std::string name;
  Axes axes;
  int end;      // the joint at the bone's far end whose place tells the bone's direction, or -1
  bool needed;  // a skeleton without it is not understood
};

std::vector<Driver> make_drivers() {
  std::vector<Driver> out = {
      {kPelvis, "Hips", Axes::kLeg, -1, true},      {kSpine1, "Spine", Axes::kTrunk, -1, true},
      {kSpine2, "Spine1", Axes::kTrunk, -1, false}, {kSpine3, "Spine2", Axes::kTrunk, -1, false},
      {kNeck, "Neck", Axes::kTrunk, -1, false},     {kHead, "Head", Axes::kTrunk, -1, true},
  };
  for (int side = 0; side < 2; ++side) {
    const std::string s = side == 0 ? "Left" : "Right";
    const Axes arm = side == 0 ? Axes::kLeftArm : Axes::kRightArm;
    const int fingers = side == 0 ? kLeftIndex1 : kRightIndex1;
    out.push_back({kLeftHip + side, s + "UpLeg", Axes::kLeg, kLeftKnee + side, true});
    out.push_back({kLeftKnee + side, s + "Leg", Axes::kLeg, kLeftAnkle + side, true});
    out.push_back({kLeftAnkle + side, s + "Foot", Axes::kFoot, kLeftFoot + side, true});
    out.push_back({kLeftFoot + side, s + "ToeBase", Axes::kToes, -1, true});
    out.push_back({kLeftCollar + side, s + "Shoulder", arm, -1, false});
    out.push_back({kLeftShoulder + side, s + "Arm", arm, kLeftElbow + side, true});
    out.push_back({kLeftElbow + side, s + "ForeArm", arm, kLeftWrist + side, true});
    out.push_back({kLeftWrist + side, s + "Hand", arm, fingers + 3, true});
    constexpr std::array<const char*, 5> kFingers = {"Index", "Middle", "Pinky", "Ring",
                                                     "Thumb"};  // in the order of the 55 joints
    for (int finger = 0; finger < 5; ++finger) {
      for (int i = 0; i < 3; ++i) {
        const int joint = fingers + 3 * finger + i;
        out.push_back({joint,
                       s + "Hand" + kFingers[static_cast<size_t>(finger)] + std::to_string(i + 1),
                       arm, i < 2 ? joint + 1 : -1, false});
      }
    }
  }
  return out;
}

std::string_view without_prefix(std::string_view name) {
  const size_t colon = name.rfind(':');
  if (colon != std::string_view::npos) return name.substr(colon + 1);
  constexpr std::string_view kAvatar = "Avatar_";
  return name.starts_with(kAvatar) ? name.substr(kAvatar.size()) : name;
}

// The node of every driver, or -1.
std::vector<int> find_nodes(const Gltf& gltf, const std::vector<Driver>& drivers) {
  std::vector<int> nodes(drivers.size(), -1);
  size_t found = 0;
  for (size_t n = 0; n < gltf.nodes.size(); ++n) {
    const std::string_view name = without_prefix(gltf.nodes[n].name);
    const auto driver = std::find_if(drivers.begin(), drivers.end(),
                                     [&](const Driver& d) { return d.name == name; });
    if (driver == drivers.end()) continue;
    int& node = nodes[static_cast<size_t>(driver - drivers.begin())];
    if (node >= 0)
      throw InputError(gltf.where + ": nodes[" + std::to_string(n) + "].name: a second joint " +
                       driver->name);
    node = static_cast<int>(n);
    ++found;
  }
  if (found == 0)
    throw InputError(gltf.where +
                     ": nodes: no joint has a known name (Hips, LeftUpLeg, RightHandIndex1, ...)");
  for (size_t d = 0; d < drivers.size(); ++d) {
    if (drivers[d].needed && nodes[d] < 0)
      throw InputError(gltf.where + ": nodes: no joint " + drivers[d].name);
  }
  return nodes;
}

struct WorldPose {
  std::vector<Quat> rotation;  // the product of the rotations alone: scales of a skeleton's joints
                               // squash limbs, they do not turn them
  std::vector<Vec3> position;
};

WorldPose world_pose(const Gltf& gltf, const std::vector<GltfTransform>& local) {
  WorldPose pose{std::vector<Quat>(local.size()), std::vector<Vec3>(local.size())};
  std::vector<Eigen::Matrix3d> linear(local.size());
  for (uint32_t n : gltf.order) {
    const GltfTransform& own = local[n];
    const Eigen::Matrix3d turned = own.rotation.toRotationMatrix() * own.scale.asDiagonal();
    if (gltf.nodes[n].parent < 0) {
      pose.rotation[n] = own.rotation;
      pose.position[n] = own.translation;
      linear[n] = turned;
    } else {
      const size_t parent = static_cast<size_t>(gltf.nodes[n].parent);
      pose.rotation[n] = (pose.rotation[parent] * own.rotation).normalized();
      pose.position[n] = pose.position[parent] + linear[parent] * own.translation;
      linear[n] = linear[parent] * turned;
    }
    // Scales multiply down the tree, at last out of the range of a double.
    if (!(pose.position[n].norm() <= kMaxPlace) || !linear[n].allFinite()) {
      throw InputError(gltf.where + ": nodes[" + std::to_string(n) +
                       "]: its place in the world is out of range");
    }
  }
  return pose;
}

// A skeleton in terms of the drivers: what is asked of it by joint.
class Rig {
 public:
  explicit Rig(const Gltf& gltf)
      : gltf_(gltf), drivers_(make_drivers()), nodes_(find_nodes(gltf, drivers_)) {
    node_of_.fill(-1);
    for (size_t d = 0; d < drivers_.size(); ++d)
      node_of_[static_cast<size_t>(drivers_[d].joint)] = nodes_[d];
  }
  const std::vector<Driver>& drivers() const { return drivers_; }
  bool has(int joint) const { return joint >= 0 && node_of_[static_cast<size_t>(joint)] >= 0; }
  size_t node(int joint) const { return static_cast<size_t>(node_of_[static_cast<size_t>(joint)]); }
  std::string named(int joint) const {
    return "nodes[" + std::to_string(node(joint)) + "] (" + gltf_.nodes[node(joint)].name + ")";
  }

  // First and last key of what moves a joint, itself or above it.
  std::pair<double, double> time_span() const {
    std::vector<bool> matters(gltf_.nodes.size(), false);
    for (int n : nodes_) {
      for (; n >= 0 && !matters[static_cast<size_t>(n)];
           n = gltf_.nodes[static_cast<size_t>(n)].parent)
        matters[static_cast<size_t>(n)] = true;
    }
    double first = 1e30, last = -1;
    for (const GltfTrack& track : gltf_.tracks) {
      if (!matters[track.node]) continue;
      first = std::min(first, double{track.times_s.front()});
      last = std::max(last, double{track.times_s.back()});
    }
    if (last < 0) {
      throw InputError(gltf_.where + ": animations[" + std::to_string(gltf_.animation) +
                       "]: moves none of the skeleton's joints");
    }
    return {first, last};
  }

  // The known rig's axes are asked for: hold a pose of the file against them.
  void expect_known_axes(const WorldPose& pose) const {
    for (const Driver& driver : drivers_) {
      const bool limb = driver.joint < kLeftIndex1 && driver.end >= 0 && driver.end < kLeftIndex1;
      if (!limb || !has(driver.joint)) continue;
      const Vec3 along = pose.position[node(driver.end)] - pose.position[node(driver.joint)];
      const Vec3 axis = pose.rotation[node(driver.joint)] * Vec3::UnitY();
      if (!(along.dot(axis) > std::cos(kMaxBoneAngleRad) * along.norm()))
        fail_axes(named(driver.joint) + ": its y axis is not along the bone");
    }
    const Quat to_neutral = neutral_axes(Axes::kLeg) * pose.rotation[node(kPelvis)].conjugate();
    const Vec3 across =
        to_neutral * (pose.position[node(kLeftHip)] - pose.position[node(kRightHip)]);
    if (!(across.x() > std::cos(kMaxBoneAngleRad) * across.norm()))
      fail_axes(named(kPelvis) + ": the left leg is not at -x of its axes");
  }

 private:
  [[noreturn]] void fail_axes(const std::string& reason) const {
    throw InputError(
        gltf_.where + ": " + reason +
        ", as in the known rig; a file with a T-pose is read with --neutral zero or first");
  }
  const Gltf& gltf_;
  std::vector<Driver> drivers_;
  std::vector<int> nodes_;                  // of the drivers, or -1
  std::array<int, kJointCount> node_of_{};  // by joint
};

}  // namespace

MotionClip retarget_glb(const std::string& path, const figurine::Body& body,
                        const RetargetOptions& options, RetargetReport* report) {
  const Gltf gltf = read_glb(path, options.animation);
  const Rig rig(gltf);
  const auto [first_s, last_s] = rig.time_span();
  const double rate = double{options.frames_per_second};
  if (!(rate >= 1 && rate <= 240)) throw InputError("fps: not within 1 and 240");
  // Times are floats: a clip of one second at 30 has 31 frames although its last key may be a
  // little early.
  const double frames = std::floor((last_s - first_s) * rate + 1e-3) + 1;
  if (frames > kMaxFrames)
    throw InputError(path + ": animations[" + std::to_string(gltf.animation) +
                     "]: more than 2^18 frames");

  RetargetSource source;
  source.where = path;
  source.frames_per_second = rate;
  source.frames = static_cast<uint32_t>(frames);
  const Neutral mode = options.neutral.value_or(Neutral::kBoneAxes);
  std::vector<GltfTransform> rest;
  for (const GltfNode& node : gltf.nodes) rest.push_back(node.rest);
  const WorldPose start = world_pose(gltf, gltf.at(first_s));
  const WorldPose neutral = mode == Neutral::kZeroPose ? world_pose(gltf, rest) : start;
  if (mode == Neutral::kBoneAxes) rig.expect_known_axes(start);

  const auto distance = [&](int a, int b) {
    return (neutral.position[rig.node(a)] - neutral.position[rig.node(b)]).norm();
  };
  for (int side = 0; side < 2; ++side) {
    source.leg += 0.5 * (distance(kLeftHip + side, kLeftKnee + side) +
                         distance(kLeftKnee + side, kLeftAnkle + side));
  }
  if (!(source.leg > 1e-6)) throw InputError(path + ": nodes: legs of no length");

  std::array<Quat, kJointCount> neutral_from_world;
  for (const Driver& driver : rig.drivers()) {
    if (!rig.has(driver.joint)) continue;
    const size_t j = static_cast<size_t>(driver.joint);
    const Quat world = mode == Neutral::kBoneAxes ? neutral_axes(driver.axes)
                                                  : neutral.rotation[rig.node(driver.joint)];
    source.driven[j] = true;
    neutral_from_world[j] = world.conjugate();
    if (driver.end < 0) continue;
    // Feet and hands whose ends the file does not have continue the bone before.
    if (mode == Neutral::kBoneAxes) {
      source.direction[j] = world * Vec3::UnitY();
    } else if (rig.has(driver.end) && distance(driver.end, driver.joint) > 1e-6) {
      source.direction[j] =
          (neutral.position[rig.node(driver.end)] - neutral.position[rig.node(driver.joint)])
              .normalized();
    } else if (driver.joint == kLeftWrist || driver.joint == kRightWrist) {
      source.direction[j] = source.direction[j - 2];
    }
  }
  source.world_from_neutral.assign(size_t{source.frames} * kJointCount, Quat::Identity());
  source.hips.reserve(source.frames);
  for (uint32_t f = 0; f < source.frames; ++f) {
    const WorldPose pose = world_pose(gltf, gltf.at(first_s + f / rate));
    source.hips.push_back(0.5 *
                          (pose.position[rig.node(kLeftHip)] + pose.position[rig.node(kRightHip)]));
    for (uint32_t j = 0; j < kJointCount; ++j) {
      if (source.driven[j]) {
        source.world_from_neutral[size_t{f} * kJointCount + j] =
            pose.rotation[rig.node(static_cast<int>(j))] * neutral_from_world[j];
      }
    }
  }
  // The neutral frame is no motion, and must not leak into its neighbours when they are smoothed.
  const bool skip_first = mode == Neutral::kFirstFrame && source.frames > 1;
  if (skip_first) {
    source.hips[0] = source.hips[1];
    std::copy_n(source.world_from_neutral.begin() + kJointCount, kJointCount,
                source.world_from_neutral.begin());
  }
  return retarget(std::move(source), body, options, options.start.value_or(skip_first ? 1 : 0),
                  report);
}

}  // namespace figurine::body
