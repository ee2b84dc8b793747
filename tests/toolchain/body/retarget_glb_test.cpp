// glTF clips on a body: a made skeleton whose poses are known, hostile ones, and the emotes of
// @dcl/wearable-preview.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>

#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "ports/motion/clip.h"
#include "ports/motion/glb_builder.h"
#include "ports/motion/gltf.h"
#include "ports/motion/motion_files.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/posed_joints.h"
#include "toolchain/body/test_files.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body::retarget_glb_test {
namespace {

using ports::tests::GlbBuilder;
using test::direction;
using test::joints_of;
using Quat = Eigen::Quaterniond;
using Vec3 = Eigen::Vector3d;
using ports::Gltf, ports::GltfNode, ports::GltfTrack, ports::GltfTransform, ports::MotionClip,
    ports::Neutral, ports::OwnedPose, ports::RetargetOptions, ports::RetargetReport;

MotionClip retarget_glb(const std::string& path, const Body& body, const RetargetOptions& options,
                        RetargetReport* report = nullptr) {
  return value_or_throw(ports::read_clip(path, body, options, report));
}

Gltf read_glb(const std::string& path) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path));
  return value_or_throw(ports::parse_gltf(file.bytes(), path));
}

const TexelBody& texels() {
  static const TexelBody body = make_texel_body(make_mannequin(), 64);
  return body;
}

// A joint of the made person: its place in the T-pose, in centimetres, and which way its axes lie
// there.
struct Made {
  const char* name;
  const char* parent;
  Vec3 place;
  Vec3 x, y;
};

std::vector<Made> person() {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  const Vec3 foot(0, -std::sin(26 * std::numbers::pi / 180), std::cos(26 * std::numbers::pi / 180));
  std::vector<Made> out = {
      {"Hips", "", {0, 100, 0}, -x, -y},      {"Spine", "Hips", {0, 107, 0}, x, y},
      {"Spine1", "Spine", {0, 121, 0}, x, y}, {"Spine2", "Spine1", {0, 135, 0}, x, y},
      {"Neck", "Spine2", {0, 149, 0}, x, y},  {"Head", "Neck", {0, 165, 0}, x, y}};
  out.insert(out.end(), {{"LeftUpLeg", "Hips", {9, 94, 0}, -x, -y},
                         {"LeftLeg", "LeftUpLeg", {9, 49, 0}, -x, -y},
                         {"LeftFoot", "LeftLeg", {9, 8, 0}, x, foot},
                         {"LeftToeBase", "LeftFoot", Vec3(9, 8, 0) + 14 * foot, x, z},
                         {"LeftShoulder", "Spine2", {7, 146, 0}, y, x},
                         {"LeftArm", "LeftShoulder", {17, 146, 0}, y, x},
                         {"LeftForeArm", "LeftArm", {44, 146, 0}, y, x},
                         {"LeftHand", "LeftForeArm", {71, 146, 0}, y, x},
                         {"LeftHandIndex1", "LeftHand", {80, 146, 3}, y, x},
                         {"LeftHandIndex2", "LeftHandIndex1", {85, 146, 3}, y, x},
                         {"LeftHandIndex3", "LeftHandIndex2", {88, 146, 3}, y, x},
                         {"LeftHandMiddle1", "LeftHand", {80, 146, 0}, y, x}});
  const size_t count = out.size();
  static const std::map<std::string, std::string> kOther = [] {
    std::map<std::string, std::string> names;
    for (const char* part : {"UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm",
                             "Hand", "HandIndex1", "HandIndex2", "HandIndex3", "HandMiddle1"}) {
      names[std::string("Left") + part] = std::string("Right") + part;
    }
    return names;
  }();
  for (size_t i = 6; i < count; ++i) {
    const Made& left = out[i];
    const auto parent = kOther.find(left.parent);
    Made right{kOther.at(left.name).c_str(),
               parent == kOther.end() ? left.parent : parent->second.c_str(), left.place, left.x,
               left.y};
    right.place.x() = -right.place.x();
    right.y.x() = -right.y.x();  // arms along -x; legs and feet are the same
    out.push_back(right);
  }
  return out;
}

nlohmann::json list(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
nlohmann::json list(const Quat& q) { return {q.x(), q.y(), q.z(), q.w()}; }

// The person as a file: below an armature that stands z-up in centimetres, as Blender writes them.
struct MadeFile {
  GlbBuilder glb;
  std::map<std::string, int> node;
  std::map<std::string, Quat> rest;  // to the parent, in the T-pose

  // plain: all axes parallel to the world's, so that only the T-pose itself tells the directions of
  // bones.
  explicit MadeFile(const std::string& prefix = "Avatar_", bool plain = false) {
    const Quat armature(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX()));
    node[""] =
        glb.node("Armature", -1, {{"rotation", list(armature)}, {"scale", {0.01, 0.01, 0.01}}});
    std::map<std::string, std::pair<Quat, Vec3>> world = {{"", {armature, Vec3::Zero()}}};
    for (const Made& joint : person()) {
      Eigen::Matrix3d axes;
      axes << joint.x, joint.y, joint.x.cross(joint.y);
      const Quat rotation = plain ? Quat::Identity() : Quat(axes);
      const auto& [parent_rotation, parent_place] = world.at(joint.parent);
      rest[joint.name] = parent_rotation.conjugate() * rotation;
      node[joint.name] = glb.node(
          prefix + joint.name, node.at(joint.parent),
          {{"translation", list(Vec3(parent_rotation.conjugate() * (joint.place - parent_place)))},
           {"rotation", list(rest[joint.name])}});
      world[joint.name] = {rotation, joint.place};
    }
  }

  // From the T-pose at time 0 to a further turn in the joint's own frame at time 1.
  void turn(const std::string& joint, double degrees, const Vec3& axis,
            const char* interpolation = "LINEAR") {
    const Quat end =
        rest.at(joint) * Quat(Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis));
    std::vector<float> values;
    for (const Quat& q : {rest.at(joint), end})
      values.insert(values.end(), {float(q.x()), float(q.y()), float(q.z()), float(q.w())});
    glb.track(node.at(joint), "rotation", interpolation, {0, 1}, values);
  }

  std::string write(const test::TemporaryFolder& folder) const {
    const std::string path = folder / "clip.glb";
    test::write_text(path, glb.file());
    return path;
  }
};

using Joints = std::vector<Eigen::Vector3f>;

Joints joints_at(const MotionClip& clip, uint32_t frame) {
  return joints_of(texels().view(), clip.pose(frame).view());
}

void expect_t_pose(const Joints& joints) {
  for (const auto& [from, to, x] : {std::tuple{kLeftShoulder, kLeftElbow, 1.0f},
                                    {kLeftElbow, kLeftWrist, 1.0f},
                                    {kLeftWrist, kLeftMiddle1, 1.0f},
                                    {kRightShoulder, kRightElbow, -1.0f},
                                    {kRightElbow, kRightWrist, -1.0f}}) {
    EXPECT_GT(direction(joints, from, to).x() * x, 0.9999f) << int(from);
  }
  EXPECT_GT(direction(joints, kLeftIndex1, kLeftIndex1 + 1).x(), 0.9999f);
  EXPECT_LT(direction(joints, kRightIndex1 + 1, kRightIndex1 + 2).x(), -0.9999f);
  EXPECT_GT(direction(joints, kLeftPinky1, kLeftIndex1).z(), 0.95f);  // palms down
  EXPECT_GT(direction(joints, kPelvis, kNeck).y(), 0.999f);
  EXPECT_GT(direction(joints, kLeftAnkle, kLeftFoot).z(), 0.85f);
  EXPECT_LT(direction(joints, kLeftHip, kLeftKnee).y(), -0.9999f);
  EXPECT_LT(direction(joints, kRightKnee, kRightAnkle).y(), -0.9999f);
}

TEST(RetargetGlb, ATPoseToldByBoneAxesBecomesATPose) {
  const test::TemporaryFolder folder;
  MadeFile file;
  file.turn("Spine", 0, Vec3::UnitX());
  RetargetReport report;
  const MotionClip clip =
      retarget_glb(file.write(folder), texels().view(), {.frames_per_second = 30}, &report);
  EXPECT_EQ(clip.frame_count, 31u);
  expect_t_pose(joints_at(clip, 0));
  expect_t_pose(joints_at(clip, 30));
  EXPECT_LT(std::abs(report.lowest_sole_m), 0.005f);
  EXPECT_EQ(clip.pose(0).root_translation_m[0], 0);
}

TEST(RetargetGlb, ATPoseOfAnyAxesIsReadFromTheNodesOrTheFirstFrame) {
  const test::TemporaryFolder folder;
  for (const Neutral neutral : {Neutral::kZeroPose, Neutral::kFirstFrame}) {
    MadeFile file("mixamorig:", true);
    file.turn("LeftForeArm", -40, Vec3::UnitY());  // in the world's own axes: from +x towards +z
    const std::string path = file.write(folder);
    const MotionClip clip = retarget_glb(path, texels().view(), {.neutral = neutral, .name = "x"});
    EXPECT_EQ(clip.frame_count, neutral == Neutral::kZeroPose ? 31u : 30u);
    if (neutral == Neutral::kZeroPose) expect_t_pose(joints_at(clip, 0));
    const Joints joints = joints_at(clip, clip.frame_count - 1);
    const float a = 40 * std::numbers::pi_v<float> / 180;
    EXPECT_GT(
        direction(joints, kLeftElbow, kLeftWrist).dot(Eigen::Vector3f(std::cos(a), 0, std::sin(a))),
        0.99999f);
    EXPECT_GT(direction(joints, kRightElbow, kRightWrist).x(), -1.0001f);
    // The same file says nothing by its axes.
    EXPECT_NE(test::input_error([&] {
                retarget_glb(path, texels().view(), {.neutral = Neutral::kBoneAxes});
              }).find("its y axis is not along the bone"),
              std::string::npos);
  }
}

TEST(RetargetGlb, JointsTurnAboutTheirOwnAxes) {
  const test::TemporaryFolder folder;
  MadeFile file;
  file.turn("LeftForeArm", -40,
            Vec3::UnitX());  // elbows bend forward, to opposite sides of their own z
  file.turn("RightForeArm", 40, Vec3::UnitX());
  file.turn("LeftLeg", -60, Vec3::UnitX());  // a knee bends backward
  file.turn("LeftHandIndex1", 90,
            Vec3::UnitZ());  // a finger closes: down, for palms that look down
  file.turn("RightHandIndex1", 90, Vec3::UnitZ());
  file.turn("Hips", 90,
            -Vec3::UnitY());  // their y axis points down: the person turns from +z to +x
  const MotionClip clip = retarget_glb(file.write(folder), texels().view(), {});
  // Half way in time is half way in angle.
  for (const auto& [frame, share] : {std::pair{15u, 0.5f}, {30u, 1.0f}}) {
    const Joints joints = joints_at(clip, frame);
    const auto turned = [&](float degrees_up, const Eigen::Vector3f& axis,
                            const Eigen::Vector3f& v) -> Eigen::Vector3f {
      const float to_rad = share * std::numbers::pi_v<float> / 180;
      const Eigen::Vector3f bent = Eigen::AngleAxisf(degrees_up * to_rad, axis) * v;
      return Eigen::AngleAxisf(90 * to_rad, Eigen::Vector3f::UnitY()) * bent;
    };
    const Eigen::Vector3f x = Eigen::Vector3f::UnitX(), y = Eigen::Vector3f::UnitY(),
                          z = Eigen::Vector3f::UnitZ();
    EXPECT_GT(direction(joints, kLeftShoulder, kLeftElbow).dot(turned(0, y, x)), 0.99999f);
    EXPECT_GT(direction(joints, kLeftElbow, kLeftWrist).dot(turned(-40, y, x)), 0.99999f);
    EXPECT_GT(direction(joints, kRightElbow, kRightWrist).dot(turned(40, y, -x)), 0.99999f);
    EXPECT_GT(direction(joints, kLeftKnee, kLeftAnkle).dot(turned(60, x, -y)), 0.99999f);
    // Fingers go on from where the bent forearm has them: left about -z, right about z.
    EXPECT_GT(
        direction(joints, kLeftIndex1, kLeftIndex1 + 1)
            .dot(turned(-40, y,
                        Eigen::AngleAxisf(-90 * share * std::numbers::pi_v<float> / 180, z) * x)),
        share == 1 ? 0.99999f : 0.95f);
    if (share == 1) EXPECT_LT(direction(joints, kRightIndex1, kRightIndex1 + 1).y(), -0.99999f);
  }
}

TEST(RetargetGlb, StepsAndRates) {
  const test::TemporaryFolder folder;
  MadeFile file;
  file.turn("LeftForeArm", -90, Vec3::UnitX(), "STEP");
  const std::string path = file.write(folder);
  for (float rate : {1.0f, 24.0f, 60.0f}) {
    const MotionClip clip = retarget_glb(path, texels().view(), {.frames_per_second = rate});
    ASSERT_EQ(clip.frame_count, static_cast<uint32_t>(rate) + 1);
    EXPECT_EQ(clip.frames_per_second, rate);
    EXPECT_GT(direction(joints_at(clip, clip.frame_count - 2), kLeftElbow, kLeftWrist).x(),
              0.9999f);
    EXPECT_GT(direction(joints_at(clip, clip.frame_count - 1), kLeftElbow, kLeftWrist).z(),
              0.9999f);
  }
}

TEST(RetargetGlb, TheRootsPathIsKeptAndScaledByTheLegs) {
  const test::TemporaryFolder folder;
  MadeFile file;
  // The armature is z-up: one metre forward and half a metre to the left is -y and x there.
  file.glb.track(file.node["Hips"], "translation", "LINEAR", {0, 1}, {0, 0, -100, 50, 100, -100});
  RetargetReport report;
  const MotionClip clip = retarget_glb(file.write(folder), texels().view(), {}, &report);
  const auto end = clip.pose(30).root_translation_m;
  EXPECT_NEAR(end[0], 0.5f * report.scale, 1e-4f);
  EXPECT_NEAR(end[2], 1.0f * report.scale, 1e-4f);
  const auto half = clip.pose(15).root_translation_m;
  EXPECT_NEAR(half[2], 0.5f * report.scale, 1e-4f);
}

TEST(RetargetGlb, RefusesSkeletonsItDoesNotUnderstand) {
  const test::TemporaryFolder folder;
  const auto error = [&](const std::function<void(MadeFile&)>& change,
                         const RetargetOptions& options = {}) {
    MadeFile file;
    file.turn("LeftArm", 10, Vec3::UnitX());
    change(file);
    const std::string path = file.write(folder),
                      message =
                          test::input_error([&] { retarget_glb(path, texels().view(), options); });
    EXPECT_EQ(message.find('\n'), std::string::npos);
    EXPECT_EQ(message.rfind(path + ": ", 0), 0u) << message;
    return message.substr(std::min(message.size(), path.size() + 2));
  };
  EXPECT_EQ(error([](MadeFile& f) {
              for (auto& node : f.glb.json["nodes"]) node["name"] = "bone";
            }).rfind("no joint has a known name (Hips, LeftUpLeg, LeftArm, ...)", 0),
            0u);
  EXPECT_EQ(error([](MadeFile& f) {
              f.glb.json["nodes"][static_cast<size_t>(f.node["RightFoot"])].erase("name");
            }).rfind("no joint right_ankle (rightfoot)", 0),
            0u);
  EXPECT_EQ(
      error([](MadeFile& f) { f.glb.json["animations"][0]["channels"] = nlohmann::json::array(); }),
      "animations[0]: moves none of the skeleton's joints");
  EXPECT_EQ(error([](MadeFile& f) {
              f.glb.json["animations"][0]["channels"][0]["target"]["node"] = f.glb.node("prop", -1);
            }),
            "animations[0]: moves none of the skeleton's joints");
  EXPECT_EQ(error([](MadeFile&) {}, {.animation = 1}), "animations: no number 1: there are 1");
  EXPECT_EQ(error([](MadeFile&) {}, {.start = 31}), "start 31: the clip has 31 frames");
  EXPECT_NE(error([](MadeFile&) {}, {.frames = 32}).find("frames 32: only 31"), std::string::npos);
  // A mirrored skeleton: the left leg on the right.
  EXPECT_NE(error([](MadeFile& f) {
              for (const char* side : {"Left", "Right"}) {
                auto& place =
                    f.glb.json["nodes"][static_cast<size_t>(f.node[std::string(side) + "UpLeg"])]
                              ["translation"];
                place[0] = -place[0].get<double>();
              }
            }).find("(Avatar_Hips): the left leg is not at -x of its axes"),
            std::string::npos);
  EXPECT_NE(error([](MadeFile& f) { f.glb.json["nodes"][0]["scale"] = {0, 0, 0}; },
                  {.neutral = Neutral::kZeroPose})
                .find("legs of no length"),
            std::string::npos);
  EXPECT_NE(error([](MadeFile& f) {
              f.glb.json["nodes"][0]["scale"] = {1e6, 1e6, 1e6},
              f.glb.json["nodes"][1]["scale"] = {1e6, 1e6, 1e6};
            }).find("its place in the world is out of range"),
            std::string::npos);
  // A day of one frame a millisecond is not asked for by a file of two keys.
  EXPECT_EQ(error([](MadeFile& f) {
              f.glb.track(f.node["Head"], "translation", "LINEAR", {0, 99999},
                          {0, 16, 0, 0, 16, 0});
            }),
            "animations[0]: more than 2^18 frames");
  test::write_text(folder / "empty.glb", "");
  EXPECT_NE(test::input_error([&] {
              retarget_glb(folder / "empty.glb", texels().view(), {});
            }).find("empty.glb: header: the file ends early"),
            std::string::npos);
  EXPECT_NE(test::input_error([&] {
              retarget_glb(folder / "none.glb", texels().view(), {});
            }).find("none.glb"),
            std::string::npos);
}

// Sixteen clips of people, made by animators and from captures; scripts/setup toolchain fetches
// them, scripts/run names the folder.
std::vector<std::string> emotes() {
  const char* folder = std::getenv("FIGURINE_EMOTES");
  std::vector<std::string> paths;
  if (folder == nullptr || !std::filesystem::is_directory(folder)) return paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".glb") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

// World places of the source's joints, by a second way: matrices, no quaternions.
std::map<std::string, Vec3> source_places(const Gltf& gltf, double time_s) {
  const std::vector<GltfTransform> local = gltf.at(time_s);
  std::map<std::string, Vec3> out;
  for (const GltfNode& node : gltf.nodes) {
    Eigen::Affine3d world = Eigen::Affine3d::Identity();
    for (int n = static_cast<int>(&node - gltf.nodes.data()); n >= 0;
         n = gltf.nodes[static_cast<size_t>(n)].parent) {
      const GltfTransform& own = local[static_cast<size_t>(n)];
      const Quat rotation(own.rotation.w, own.rotation.x, own.rotation.y, own.rotation.z);
      world = Eigen::Translation3d(own.translation.x, own.translation.y, own.translation.z) *
              rotation * Eigen::Scaling(own.scale.x, own.scale.y, own.scale.z) * world;
    }
    out[node.name] = world.translation();
  }
  return out;
}

TEST(RetargetGlb, EmotesKeepTheirBonesDirectionsAndTheirHinges) {
  ASSERT_EQ(emotes().size(), 16u)
      << "FIGURINE_EMOTES: run this through scripts/run, after scripts/setup toolchain";
  for (const std::string& path : emotes()) {
    const std::string name = std::filesystem::path(path).stem().string();
    RetargetReport report;
    const MotionClip clip = retarget_glb(path, texels().view(), {.name = name}, &report);
    const Gltf gltf = read_glb(path);
    double first = 1e9;
    for (const GltfTrack& track : gltf.tracks)
      first = std::min(first, double{track.times_s.front()});
    float limbs = 0, fingers = 0, knee = 1, elbow = 1;
    for (uint32_t f = 0; f < clip.frame_count; f += 3) {
      const std::map<std::string, Vec3> places = source_places(gltf, first + f / 30.0);
      const Joints joints = joints_at(clip, f);
      for (int side = 0; side < 2; ++side) {
        const std::string s = side == 0 ? "Avatar_Left" : "Avatar_Right";
        const auto off = [&](const std::string& from, const std::string& to, int a, int b) {
          const Eigen::Vector3f wanted =
              (places.at(s + to) - places.at(s + from)).normalized().cast<float>();
          return std::acos(std::min(1.0f, wanted.dot(direction(joints, a, b))));
        };
        limbs = std::max({limbs, off("UpLeg", "Leg", kLeftHip + side, kLeftKnee + side),
                          off("Leg", "Foot", kLeftKnee + side, kLeftAnkle + side),
                          off("Arm", "ForeArm", kLeftShoulder + side, kLeftElbow + side),
                          off("ForeArm", "Hand", kLeftElbow + side, kLeftWrist + side)});
        int joint = side == 0 ? kLeftIndex1 : kRightIndex1;
        for (const char* finger : {"Index", "Middle", "Pinky", "Ring", "Thumb"}) {
          const std::string of = std::string("Hand") + finger;
          fingers = std::max({fingers, off(of + "1", of + "2", joint, joint + 1),
                              off(of + "2", of + "3", joint + 1, joint + 2)});
          joint += 3;
        }
        // A shin that turns backwards turns about the thigh's left.
        const OwnedPose pose = clip.pose(f);
        std::vector<Affine> world(kJointCount);
        skinning_transforms(texels().view().mean_skeleton(), pose.view(), world);
        const auto turned = [&](int j, const Eigen::Vector3f& v) -> Eigen::Vector3f {
          const auto p = transform_point(world[static_cast<size_t>(j)], v.data());
          const Eigen::Vector3f zero = Eigen::Vector3f::Zero();
          const auto o = transform_point(world[static_cast<size_t>(j)], zero.data());
          return {p[0] - o[0], p[1] - o[1], p[2] - o[2]};
        };
        const Eigen::Vector3f thigh = direction(joints, kLeftHip + side, kLeftKnee + side),
                              shin = direction(joints, kLeftKnee + side, kLeftAnkle + side);
        knee = std::min(knee,
                        thigh.cross(shin).dot(turned(kLeftHip + side, Eigen::Vector3f::UnitX())));
        // A forearm that bends forward turns about the upper arm's own vertical of the T-pose, in
        // which the mannequin rests.
        const Eigen::Vector3f upper = direction(joints, kLeftShoulder + side, kLeftElbow + side),
                              fore = direction(joints, kLeftElbow + side, kLeftWrist + side);
        elbow = std::min(
            elbow, fore.cross(upper).dot(turned(kLeftShoulder + side, Eigen::Vector3f::UnitY())) *
                       (side == 0 ? 1.0f : -1.0f));
      }
    }
    std::printf(
        "%-12s %3u frames; limbs %.2f, fingers %.2f degrees off; knee %.2f elbow %.2f; soles %.1f "
        "mm mean, lowest %.1f mm; step %.1f "
        "degrees\n",
        name.c_str(), clip.frame_count, 57.3 * double{limbs}, 57.3 * double{fingers}, double{knee},
        double{elbow}, 1e3 * double{report.mean_contact_m}, 1e3 * double{report.lowest_sole_m},
        57.3 * double{report.largest_step_rad});
    EXPECT_LT(limbs, 0.01f);
    EXPECT_LT(fingers, 0.01f);
    EXPECT_GT(knee, -0.1f);
    EXPECT_GT(elbow, -0.25f);  // "fashion" itself overstretches an elbow by 17 degrees
    EXPECT_LT(report.mean_contact_m, 0.02f);
    EXPECT_GT(report.lowest_sole_m, -0.05f);
  }
}

// As in retarget_test.cpp: what the toolchain's own reader made of them.
TEST(RetargetGlb, EmotesAreWhatTheyWereToTheBit) {
  const std::map<std::string, std::string> wanted = {
      {"clap.glb", "11851139cd05b361bedc3923718e502a"},
      {"dab.glb", "fe50bfb6a2ea54edf4c9a68af8bd6d5f"},
      {"dance.glb", "06489eb4ec0059334c3d6fd0a52747b9"},
      {"fashion-2.glb", "86781d78931e0e8914bc9fbd30b13503"},
      {"fashion-3.glb", "5ca55a78d78cf312e14359f1f8ab449f"},
      {"fashion-4.glb", "197ddadf1acf5cc0e61cb86945c7dc37"},
      {"fashion.glb", "1d91196a2499ac445c4b157797941f99"},
      {"fist-pump.glb", "6cda2bc1be42a1b192aa6517b1886a36"},
      {"head-explode.glb", "fea4e004a363bdc07b77a4aebe088a4f"},
      {"idle.glb", "c11cdd6e98dd913f7542fd0a1f161241"},
      {"jump.glb", "3ca820d0a657fd68a6d47ce73f24e0b1"},
      {"love.glb", "e07a8a978962cdd5e5c6024bc7095d6e"},
      {"money.glb", "b101821d0058b9af006253c60ebcffe2"},
      {"run.glb", "30d19df268714659aad5feba39537f2d"},
      {"walk.glb", "3a168baf7789d210137c66c4beca4f74"},
      {"wave.glb", "3957250ed35489abae863d18351882f7"}};
  const ports::MappedFile file =
      value_or_throw(ports::MappedFile::open(FIGURINE_SOURCE_DIR "/samples/packages/body-64.fgn"));
  const Package body = value_or_throw(Package::open(file.bytes(), "body"));
  ASSERT_EQ(emotes().size(), wanted.size());
  for (const std::string& path : emotes()) {
    const MotionClip clip = retarget_glb(path, body.body(), {.name = "digest"});
    EXPECT_EQ(ports::tests::content_hash(clip),
              wanted.at(std::filesystem::path(path).filename().string()))
        << path;
    EXPECT_NE(value_or_throw(ports::clip_source(path)).find("@dcl/wearable-preview 1.28.1"),
              std::string::npos);
  }
}

TEST(RetargetGlb, EmotesStandUprightAndFaceForward) {
  ASSERT_EQ(emotes().size(), 16u)
      << "FIGURINE_EMOTES: run this through scripts/run, after scripts/setup toolchain";
  for (const std::string& path : emotes()) {
    const MotionClip clip = retarget_glb(path, texels().view(), {});
    const Joints joints = joints_at(clip, 0);
    const Eigen::Vector3f across = direction(joints, kRightShoulder, kLeftShoulder),
                          up = direction(joints, kPelvis, kNeck);
    EXPECT_GT(across.cross(up).z(), 0.7f) << path;
    EXPECT_GT(up.y(), 0.9f) << path;
  }
}

}  // namespace
}  // namespace figurine::body::retarget_glb_test
