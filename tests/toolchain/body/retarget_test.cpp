// Retargeting: a T-pose stays a T-pose, bones keep their direction, the CMU clips walk without
// broken knees and with feet on the ground.
#include "ports/motion/retarget_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "formats/writer/package_writer.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "ports/motion/clip.h"
#include "ports/motion/gaze.h"
#include "ports/motion/motion_files.h"
#include "ports/motion/motion_loop.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/posed_joints.h"
#include "toolchain/body/test_files.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body::retarget_test {
namespace {

using test::direction;
using test::joints_of;
using Vec3 = Eigen::Vector3f;
using ports::Bvh, ports::BvhJoint, ports::LoopReport, ports::MotionClip, ports::Neutral,
    ports::OwnedPose, ports::RetargetOptions, ports::RetargetReport;

const TexelBody& texels() {
  static const TexelBody body = make_texel_body(make_mannequin(), 64);
  return body;
}

const Bvh& clip_0103() {
  static const std::string path = "/usr/share/assimp/models/BVH/01_03.bvh";
  static const Bvh bvh = [] {
    const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path));
    const auto bytes = file.bytes();
    return value_or_throw(
        ports::parse_bvh({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path));
  }();
  return bvh;
}

MotionClip retarget_bvh(Bvh bvh, const Body& body, const RetargetOptions& options,
                        RetargetReport* report = nullptr) {
  const auto tree = value_or_throw(ports::bvh_tree(std::move(bvh), options));
  return value_or_throw(ports::retarget_tree(*tree, {}, body, options, report));
}

MotionClip retarget_npz(const std::string& path, const Body& body, const RetargetOptions& options,
                        RetargetReport* report = nullptr) {
  return value_or_throw(ports::read_clip(path, body, options, report));
}

MotionClip looped(const MotionClip& clip, const ports::LoopOptions& options,
                  LoopReport* report = nullptr) {
  return value_or_throw(ports::make_loop(clip, options, report));
}

// The neutral frame of CMU's clip twice: what a person standing in a T-pose looks like.
Bvh t_pose() {
  Bvh bvh = clip_0103();
  bvh.values.resize(bvh.channel_count);
  bvh.values.insert(bvh.values.end(), bvh.values.begin(),
                    bvh.values.begin() + static_cast<std::ptrdiff_t>(bvh.channel_count));
  bvh.frame_count = 2;
  return bvh;
}

TEST(Retarget, TPoseBecomesATPose) {
  const MotionClip clip = retarget_bvh(t_pose(), texels().view(), {.frames_per_second = 120});
  ASSERT_EQ(clip.frame_count, 1u);
  const figurine::Motion motion = clip.view();
  const std::vector<Vec3> joints = joints_of(texels().view(), motion.pose(0));
  for (const auto& [from, to, x] : {std::tuple{kLeftShoulder, kLeftElbow, 1.0f},
                                    {kLeftElbow, kLeftWrist, 1.0f},
                                    {kLeftWrist, kLeftMiddle1, 1.0f},
                                    {kRightShoulder, kRightElbow, -1.0f},
                                    {kRightElbow, kRightWrist, -1.0f}}) {
    EXPECT_GT(direction(joints, from, to).dot(Vec3(x, 0, 0)), 0.996)
        << int(from);  // the clip's T-pose droops by 5 degrees
  }
  // Palms down: the index lies in front of the pinky, and fingers curl downward.
  for (int shift : {0, kRightIndex1 - kLeftIndex1}) {
    const auto at = [&](int j) -> Vec3 { return joints[static_cast<size_t>(j + shift)]; };
    EXPECT_GT((at(kLeftIndex1) - at(kLeftPinky1)).normalized().z(), 0.95);
    EXPECT_LT(at(kLeftMiddle1 + 2).y(), at(kLeftMiddle1).y() - 0.01);
  }
  // Upright, facing +z, the feet under the hips.
  EXPECT_GT(direction(joints, kPelvis, kNeck).y(), 0.999);
  EXPECT_GT(direction(joints, kLeftAnkle, kLeftFoot).z(), 0.85);
  EXPECT_LT(direction(joints, kLeftHip, kLeftKnee).y(), -0.99);
}

TEST(Retarget, BonesKeepTheSourcesWorldDirection) {
  // One elbow of the hierarchy's zero pose bent forward by 40 degrees and the root turned by 90:
  // the forearm points where the source's points.
  Bvh bvh = t_pose();
  std::fill(bvh.values.begin(), bvh.values.end(), 0.0f);
  float* frame = bvh.values.data();
  const BvhJoint& hips = bvh.joints[0];
  const BvhJoint& forearm = bvh.joints[static_cast<size_t>(bvh.find("LeftForeArm"))];
  frame[hips.first_channel + 4] = 90;      // Yrotation: +z to +x, +x to -z
  frame[forearm.first_channel + 1] = -40;  // from +x towards +z, before the turn
  const MotionClip clip =
      retarget_bvh(bvh, texels().view(),
                   {.frames_per_second = 120, .neutral = Neutral::kZeroPose, .smooth_s = 0});
  const figurine::Motion motion = clip.view();
  const std::vector<Vec3> joints = joints_of(texels().view(), motion.pose(0));
  const float a = 40 * std::numbers::pi_v<float> / 180;
  EXPECT_GT(direction(joints, kLeftShoulder, kLeftElbow).dot(Vec3(0, 0, -1)), 0.99999);
  EXPECT_GT(direction(joints, kLeftElbow, kLeftWrist).dot(Vec3(std::sin(a), 0, -std::cos(a))),
            0.99999);
}

struct Walk {
  uint32_t start, frames;
};

TEST(Retarget, CmuWalksHaveSoundKneesElbowsAndFeet) {
  // The walking parts of 01_03, frames of the file at 120 a second.
  for (const Walk& walk : {Walk{1, 76}, Walk{1473, 50}, Walk{2241, 55}, Walk{3329, 55}}) {
    RetargetReport report;
    const MotionClip clip = retarget_bvh(clip_0103(), texels().view(),
                                         {.start = walk.start, .frames = walk.frames}, &report);
    const figurine::Motion motion = clip.view();
    float knee = 1e9f, elbow = 1e9f, hands = 1e9f;
    for (uint32_t f = 0; f < clip.frame_count; ++f) {
      const std::vector<Vec3> joints = joints_of(texels().view(), motion.pose(f));
      const Vec3 left = direction(joints, kRightHip, kLeftHip);
      const Vec3 up = direction(joints, kPelvis, kSpine3), front = left.cross(up);
      for (int side = 0; side < 2; ++side) {
        // A shin that turns backwards turns about +left from the thigh; an inverted knee would turn
        // the other way.
        knee = std::min(knee, direction(joints, kLeftHip + side, kLeftKnee + side)
                                  .cross(direction(joints, kLeftKnee + side, kLeftAnkle + side))
                                  .dot(left));
        // Forearms of hanging arms bend to the front of the chest.
        const Vec3 upper_arm = direction(joints, kLeftShoulder + side, kLeftElbow + side);
        const Vec3 forearm = direction(joints, kLeftElbow + side, kLeftWrist + side);
        const Vec3 chest_front = direction(joints, kRightShoulder, kLeftShoulder).cross(up);
        if (upper_arm.dot(up) < -0.7f)
          elbow = std::min(elbow, (forearm - upper_arm).dot(chest_front));
        // Wrists stay outside the trunk: an ellipse of 15 x 10 cm around the spine below the chest.
        const Vec3 wrist = joints[static_cast<size_t>(kLeftWrist + side)] - joints[kSpine1];
        hands = std::min(hands,
                         Eigen::Vector2f(wrist.dot(left) / 0.15f, wrist.dot(front) / 0.10f).norm());
      }
    }
    std::printf(
        "frames %u + %u: knee %.3f elbow %.3f wrist %.2f; soles %.1f mm mean, lowest %.1f mm; "
        "largest step %.1f degrees\n",
        walk.start, walk.frames, double{knee}, double{elbow}, double{hands},
        1e3 * double{report.mean_contact_m}, 1e3 * double{report.lowest_sole_m},
        57.3 * double{report.largest_step_rad});
    EXPECT_GT(knee, -0.03);  // straight legs may read as a degree or two
    EXPECT_GT(elbow, -0.15);
    EXPECT_GT(hands, 1);
    EXPECT_LT(report.mean_contact_m, 0.010);
    EXPECT_GT(report.lowest_sole_m, -0.03);
    EXPECT_LT(report.largest_step_rad, 0.6);
  }
}

TEST(Retarget, PlantedFeetDoNotSlide) {
  const MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {.start = 1, .frames = 76});
  const figurine::Motion motion = clip.view();
  // Right foot between output frames 18 and 27: mid-stance.
  const Vec3 before = joints_of(texels().view(), motion.pose(18))[kRightFoot],
             after = joints_of(texels().view(), motion.pose(27))[kRightFoot];
  const Vec3 root_before = joints_of(texels().view(), motion.pose(18))[kPelvis],
             root_after = joints_of(texels().view(), motion.pose(27))[kPelvis];
  std::printf("stance foot moves %.1f mm while the root moves %.1f mm\n",
              1e3 * double{(after - before).norm()},
              1e3 * double{(root_after - root_before).norm()});
  EXPECT_LT((after - before).norm(), 0.015);
  EXPECT_GT((root_after - root_before).norm(), 0.15);
}

TEST(Retarget, QuaternionsAreUnitAndContinuous) {
  const MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {});
  EXPECT_EQ(clip.frame_count, 1128u);
  const size_t stride = size_t{kJointCount} * 4;
  float worst = 0, dot = 1;
  for (size_t i = 0; i < clip.rotations.size(); i += 4) {
    float length = 0, product = 0;
    for (size_t k = 0; k < 4; ++k) {
      length += clip.rotations[i + k] * clip.rotations[i + k];
      if (i >= stride) product += clip.rotations[i + k] * clip.rotations[i + k - stride];
    }
    worst = std::max(worst, std::abs(length - 1));
    if (i >= stride) dot = std::min(dot, product);
  }
  EXPECT_LT(worst, 1e-5);
  EXPECT_GT(dot, 0.9);
}

TEST(Retarget, RefusesWhatTheClipDoesNotHave) {
  const auto error = [&](const RetargetOptions& options) {
    return test::input_error([&] { retarget_bvh(clip_0103(), texels().view(), options); });
  };
  EXPECT_NE(error({.start = 99999, .name = "x"}).find("01_03.bvh: start 99999"), std::string::npos);
  EXPECT_NE(error({.frames = 99999, .name = "x"}).find("01_03.bvh: frames 99999: only 1128"),
            std::string::npos);
  Bvh renamed = clip_0103();
  renamed.joints[static_cast<size_t>(renamed.find("LeftFoot"))].name = "l_fuss";
  EXPECT_NE(test::input_error([&] {
              retarget_bvh(renamed, texels().view(), {});
            }).find("no joint left_ankle (leftfoot); nearest: "),
            std::string::npos);
}

// AMASS-style files of two frames, all joints in the rest pose but the root.
std::string amass(const test::TemporaryFolder& folder, size_t columns,
                  const std::string& rate_key = "mocap_frame_rate") {
  std::vector<double> poses(2 * columns, 0.0);
  for (size_t f = 0; f < 2; ++f)
    poses[f * columns] = std::numbers::pi / 2;  // z-up data stands by a turn about x
  const std::string path = folder / "amass.npz";
  test::write_npz(path, {{"poses", test::npy_bytes("<f8", {2, columns}, poses)},
                         {"trans", test::npy_bytes("<f8", {2, 3}, {1, 2, 0.9, 1, 1, 0.9})},
                         {rate_key, test::npy_bytes("<f8", {}, {30})},
                         {"betas", test::npy_bytes("<f8", {16}, std::vector<double>(16))}});
  return path;
}

TEST(Retarget, ZeroSmplxPoseIsATPoseOnItsFeet) {
  const test::TemporaryFolder folder;
  for (size_t columns : {165, 156, 72, 66}) {
    RetargetReport report;
    const MotionClip clip =
        retarget_npz(amass(folder, columns, columns == 66 ? "mocap_framerate" : "mocap_frame_rate"),
                     texels().view(), {.smooth_s = 0}, &report);
    ASSERT_EQ(clip.frame_count, 2u);
    const figurine::Motion motion = clip.view();
    const std::vector<Vec3> joints = joints_of(texels().view(), motion.pose(0));
    EXPECT_GT(direction(joints, kLeftShoulder, kLeftElbow).x(), 0.999);
    EXPECT_GT(direction(joints, kRightElbow, kRightWrist).dot(Vec3(-1, 0, 0)), 0.999);
    EXPECT_GT(direction(joints, kPelvis, kHead).y(), 0.99);
    EXPECT_LT(std::abs(report.lowest_sole_m), 0.002);
    // One metre along -y of the z-up world is one (scaled) metre along +z.
    const std::vector<Vec3> later = joints_of(texels().view(), motion.pose(1));
    EXPECT_NEAR((later[kPelvis] - joints[kPelvis]).z(), report.scale, 1e-4);
  }
}

TEST(Retarget, BadNpzIsOneClearLine) {
  const test::TemporaryFolder folder;
  EXPECT_NE(test::input_error([&] {
              retarget_npz(amass(folder, 75), texels().view(), {});
            }).find("poses: 75 columns"),
            std::string::npos);
  const std::string path = folder / "bad.npz";
  test::write_npz(
      path, {{"poses", test::npy_bytes("<f8", {1, 66}, std::vector<double>(66, std::nan("")))},
             {"trans", test::npy_bytes("<f8", {1, 3}, {0, 0, 0})},
             {"mocap_framerate", test::npy_bytes("<f8", {}, {30})}});
  EXPECT_NE(test::input_error([&] {
              retarget_npz(path, texels().view(), {});
            }).find("poses: a value is not finite"),
            std::string::npos);
}

float largest_step(const MotionClip& clip, uint32_t from, uint32_t to) {
  float step = 0;
  for (size_t j = 0; j < kJointCount; ++j) {
    const auto rotation = [&](uint32_t f) {
      const float* q = &clip.rotations[(size_t{f} * kJointCount + j) * 4];
      return Eigen::Quaternionf(q[0], q[1], q[2], q[3]);
    };
    step = std::max(step, rotation(from).angularDistance(rotation(to)));
  }
  return step;
}

TEST(MotionLoop, RepeatsWithoutASeamAndWalksStraight) {
  const MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {.start = 1, .frames = 76});
  LoopReport report;
  const MotionClip loop = looped(clip, {.cycles = 3}, &report);
  const uint32_t length = report.length;
  ASSERT_EQ(loop.frame_count, 3 * length);
  std::printf("cycle of %u frames, gap %.1f degrees\n", length, 57.3 * double{report.gap_rad});
  EXPECT_LT(report.gap_rad, 0.2);
  // The same pose a cycle later, and the seam is no larger a step than the gait's own.
  float within = 0;
  for (uint32_t f = 0; f + 1 < length; ++f) {
    within = std::max(within, largest_step(loop, f, f + 1));
    EXPECT_LT(largest_step(loop, f, f + length), 2e-3) << f;
  }
  EXPECT_LT(largest_step(loop, length - 1, length), within);
  EXPECT_LT(largest_step(loop, loop.frame_count - 1, 0), within);
  // Straight along +z at a walking pace, hips swaying.
  const float pace =
      (loop.root_translation_m[3 * size_t{length} + 2] - loop.root_translation_m[2]) /
      (static_cast<float>(length) / 30);
  EXPECT_GT(pace, 0.7);
  EXPECT_LT(pace, 1.6);
  for (uint32_t f = 0; f < loop.frame_count; ++f) {
    const float* q = &loop.rotations[size_t{f} * kJointCount * 4];
    EXPECT_LT(
        std::abs(std::atan2(2 * (q[1] * q[3] + q[0] * q[2]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]))),
        0.2)
        << f;
    EXPECT_LT(std::abs(loop.root_translation_m[size_t{f} * 3]), 0.08);
  }
}

TEST(MotionLoop, InPlaceStaysInPlace) {
  const MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {.start = 1, .frames = 76});
  const MotionClip loop = looped(clip, {.cycles = 2, .in_place = true});
  for (size_t i = 0; i < loop.root_translation_m.size(); ++i) {
    if (i % 3 != 1) {
      EXPECT_LT(std::abs(loop.root_translation_m[i]), 0.08);
    }
  }
  const MotionClip short_clip =
      retarget_bvh(clip_0103(), texels().view(), {.start = 1, .frames = 20, .name = "short"});
  EXPECT_NE(
      test::input_error([&] { looped(short_clip, {}); }).find("short: loop: 20 frames are too few"),
      std::string::npos);
}

TEST(MotionClip, SurvivesThePackage) {
  const test::TemporaryFolder folder;
  MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {.frames = 10, .name = "walk"});
  const auto bytes = write_package(clip.view(), Provenance{});
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  ASSERT_TRUE(ports::write_file_atomically(folder / "walk.fgn", *bytes).ok());
  const MotionClip back = value_or_throw(ports::read_motion_clip(folder / "walk.fgn"));
  EXPECT_EQ(back.rotations, clip.rotations);
  EXPECT_EQ(back.root_translation_m, clip.root_translation_m);
  EXPECT_EQ(back.name, "walk");
  EXPECT_NE(ports::read_motion_clip(folder / "none.fgn").status().message().find("none.fgn"),
            std::string::npos);
}

TEST(MotionClip, TurningTurnsAboutTheVerticalThroughTheRoot) {
  const MotionClip clip = retarget_bvh(clip_0103(), texels().view(), {.frames = 20});
  const OwnedPose pose = clip.pose(13);
  const float angle = 0.7f;
  const std::vector<Vec3> before = joints_of(texels().view(), pose.view()),
                          after = joints_of(texels().view(), ports::turned(pose, angle).view());
  float worst = 0;
  for (size_t j = 0; j < kJointCount; ++j) {
    const Vec3 wanted =
        before[0] + Eigen::AngleAxisf(angle, Vec3::UnitY()) * (before[j] - before[0]);
    worst = std::max(worst, (after[j] - wanted).norm());
  }
  EXPECT_LT(worst, 1e-5);
}

// Content hashes of the packages that the toolchain's own readers made of these clips, at commit
// 23fe52d, on the shipped body and under the name "digest".
TEST(RetargetBits, CapturesAreWhatTheyWere) {
  const ports::MappedFile file =
      value_or_throw(ports::MappedFile::open(FIGURINE_SOURCE_DIR "/samples/packages/body-64.fgn"));
  const Package body = value_or_throw(Package::open(file.bytes(), "body"));
  const std::string folder = "/usr/share/assimp/models/BVH/";
  const auto hash = [&](const MotionClip& clip) { return ports::tests::content_hash(clip); };
  const auto read = [&](const std::string& name, RetargetOptions options) {
    options.name = "digest";
    return value_or_throw(ports::read_clip(folder + name, body.body(), options));
  };
  EXPECT_EQ(hash(read("01_01.bvh", {})), "ddd631b5004910559a56d4a0e46bf004");
  EXPECT_EQ(hash(read("01_03.bvh", {})), "607aa027028352d70faa749f3898f809");
  EXPECT_EQ(hash(read("01_03.bvh", {.frames = 50, .neutral = Neutral::kZeroPose})),
            "0285a94c821e98936d2882c97a410622");
  const MotionClip walk = read("01_03.bvh", {.start = 1, .frames = 76});
  EXPECT_EQ(hash(looped(walk, {.cycles = 3})), "de77fddb530161ec632ef8280dcdfde4");
  EXPECT_EQ(hash(value_or_throw(
                ports::with_head_pitch(looped(walk, {.cycles = 2, .in_place = true}), 0))),
            "eb64c48c43eb3ef78b4a3a546569317b");
  EXPECT_NE(value_or_throw(ports::clip_source(folder + "01_03.bvh")).find("mocap.cs.cmu.edu"),
            std::string::npos);
}

}  // namespace
}  // namespace figurine::body::retarget_test
