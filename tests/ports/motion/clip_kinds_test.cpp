// Kinds of clips beyond the examples of tests/data/cases: axes, headings, rates, files of SMPL's
// parameters, provenance, smoothing, and what cannot be a person.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "ports/motion/glb_builder.h"
#include "ports/motion/import.h"
#include "ports/motion/made_person.h"
#include "ports/motion/motion_files.h"

namespace figurine::ports::clip_kinds_test {
namespace {

using tests::bone;
using tests::joints_of;
using tests::MadePerson;
using tests::npy_bytes;
using tests::shipped_body;

constexpr double kRight = std::numbers::pi / 2;

struct Read {
  MotionClip clip;
  std::string summary, error;
  bool says(const std::string& words) const { return summary.find(words) != std::string::npos; }
  bool fails(const std::string& words) const { return error.find(words) != std::string::npos; }
};

Read read(const std::string& bytes, ClipKind kind, const RetargetOptions& options = {}) {
  Read out;
  RetargetReport report;
  Result<MotionClip> clip =
      read_clip(tests::bytes_of(bytes), "clip", kind, shipped_body(), options, &report);
  out.summary = report.summary;
  if (clip.ok()) {
    out.clip = std::move(clip).value();
  } else {
    out.error = clip.status().message();
    EXPECT_EQ(out.error.find('\n'), std::string::npos);
  }
  return out;
}

Read read(const MadePerson& person, const RetargetOptions& options = {}) {
  return read(person.text(), ClipKind::kBvh, options);
}

double lean(const MotionClip& clip) {  // the least upright frame, degrees
  double most = 0;
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const auto joints = joints_of(shipped_body(), clip, f);
    most = std::max(most, 57.3 * std::acos(bone(joints, kPelvis, kNeck).y));
  }
  return most;
}

double apart(const MotionClip& a, const MotionClip& b) {
  EXPECT_EQ(a.frame_count, b.frame_count);
  double largest = 0;
  for (uint32_t f = 0; f < std::min(a.frame_count, b.frame_count); ++f) {
    const auto one = joints_of(shipped_body(), a, f), other = joints_of(shipped_body(), b, f);
    for (size_t j = 0; j < kJointCount; ++j) largest = std::max(largest, length(one[j] - other[j]));
  }
  return largest;
}

TEST(ClipAxes, EveryAxisThatPointsUpIsSeenAndMayBeSaid) {
  const MotionClip plain = read(MadePerson()).clip;
  ASSERT_EQ(plain.frame_count, 19u);
  for (const ClipUp up :
       {ClipUp::kZ, ClipUp::kX, ClipUp::kMinusY, ClipUp::kMinusZ, ClipUp::kMinusX}) {
    MadePerson person;
    person.axes = reversed(world_from_clip(up));
    const Read seen = read(person), told = read(person, {.up = up});
    EXPECT_TRUE(seen.says(std::string("up ") + to_string(up) + " (as the person stands)"))
        << seen.summary << seen.error;
    EXPECT_LT(apart(seen.clip, plain), 1e-4) << to_string(up);
    EXPECT_LT(apart(told.clip, plain), 1e-4) << to_string(up);
  }
}

TEST(ClipAxes, AStandingPersonStandsWithoutAStep) {
  MadePerson person;
  person.step_cm = 0;
  person.axes = reversed(world_from_clip(ClipUp::kZ));
  const Read seen = read(person);
  EXPECT_TRUE(seen.says("up z (as the person stands)")) << seen.summary << seen.error;
  EXPECT_LT(lean(seen.clip), 15);
}

TEST(ClipAxes, WhoLiesOrTumblesMayLie) {
  // Upright in the T-pose, then flat on the back: no other axis is up.
  MadePerson person;
  person.step_cm = 0;
  person.pose = [](int f) {
    std::map<std::string, Quat> pose = MadePerson::walk(f);
    pose["Hips"] = about({1, 0, 0}, -kRight);
    return pose;
  };
  const Read lying = read(person);
  EXPECT_TRUE(lying.says("up y,")) << lying.summary << lying.error;
  EXPECT_GT(lean(lying.clip), 80);
  // Swimming along the own trunk is no walking on the back.
  person.step_cm = 10;
  person.forward = {0, 0, -1};
  EXPECT_EQ(read(person).error, "");
  // Walking across it is.
  person.forward = {1, 0, 0};
  EXPECT_TRUE(read(person).fails("the person lies while it walks (--up says"))
      << read(person).error;
  EXPECT_EQ(read(person, {.checked = false}).error, "");
}

TEST(ClipAxes, ATPoseMayFaceAnyWay) {
  const MotionClip plain = read(MadePerson()).clip;
  for (const double heading : {90.0, 180.0, -90.0, 37.0}) {
    MadePerson person;
    const Quat turn = about({0, 1, 0}, heading / 180 * std::numbers::pi);
    person.axes = turn;
    const Read turned = read(person);
    ASSERT_EQ(turned.error, "");
    // The same person on the same way, turned as the file has it.
    double largest = 0;
    for (uint32_t f = 0; f < plain.frame_count; ++f) {
      const auto one = joints_of(shipped_body(), plain, f),
                 other = joints_of(shipped_body(), turned.clip, f);
      for (size_t j = 0; j < kJointCount; ++j) {
        largest = std::max(largest, length(rotated(turn, one[j] - one[0]) - (other[j] - other[0])));
      }
    }
    EXPECT_LT(largest, 1e-3) << heading;
  }
}

TEST(ClipNeutral, AFirstFrameThatIsNoTPoseIsNoticed) {
  MadePerson reference;
  reference.t_pose_first = false;
  const MotionClip wanted = read(reference, {.neutral = Neutral::kZeroPose}).clip;
  const std::pair<const char*, std::map<std::string, Quat>> poses[] = {
      {"its trunk leans by 20", {{"Spine", about({1, 0, 0}, 0.5)}}},
      {"its trunk leans by 17", {{"Hips", about({0, 0, 1}, 0.3)}}},
      {"its spine3 is turned by 14", {{"Spine2", about({1, 0, 0}, 0.25)}}},
      {"its head is turned by 23", {{"Head", about({0, 1, 0}, 0.4)}}},
      {"its pelvis is turned by 20", {{"Hips", about({0, 1, 0}, 0.35)}}},
      {"its left arm hangs", {{"LeftArm", about({0, 0, 1}, -1.4)}}},
      {"its left arm is raised", {{"LeftArm", about({0, 0, 1}, 1.2)}}},
      {"its right arm does not point outwards", {{"RightArm", about({0, 1, 0}, 0.8)}}},
      {"its right leg is bent", {{"RightUpLeg", about({1, 0, 0}, -0.6)}}},
      {"its left leg is bent", {{"LeftLeg", about({1, 0, 0}, 0.9)}}},
      {"its left elbow is bent",
       {{"LeftArm", about({0, 0, 1}, -0.4)}, {"LeftForeArm", about({0, 0, 1}, 0.8)}}}};
  for (const auto& [reason, bent] : poses) {
    MadePerson person = reference;
    person.pose = [bent = bent](int f) { return f == 0 ? bent : MadePerson::walk(f); };
    const Read seen = read(person);
    EXPECT_TRUE(
        seen.says(std::string("T-pose from the zero pose (the first frame is none: ") + reason))
        << reason << ": " << seen.summary << seen.error;
    // Later frames are what they are with a sound clip.
    ASSERT_EQ(seen.clip.frame_count, wanted.frame_count);
    const auto one = joints_of(shipped_body(), seen.clip, 15),
               other = joints_of(shipped_body(), wanted, 15);
    EXPECT_LT(length((one[kHead] - one[0]) - (other[kHead] - other[0])), 1e-3) << reason;
  }
}

TEST(ClipNeutral, WithoutAnyTPoseTheOptionIsNamed) {
  MadePerson person;
  person.t_pose_first = false;
  for (tests::MadeJoint& joint : person.joints) {  // all bones along x, as some tools rest
    if (joint.parent >= 0) joint.offset = {length(joint.offset), 0, 0};
  }
  const Read seen = read(person);
  EXPECT_TRUE(seen.fails("no T-pose: of the first frame its ")) << seen.error;
  EXPECT_TRUE(seen.fails("--neutral first, zero or a frame takes one as it is")) << seen.error;
  // An A-pose of the hierarchy is one, of the motion it may be a person who stands about.
  MadePerson a_pose;
  a_pose.t_pose_first = false;
  for (tests::MadeJoint& joint : a_pose.joints) {
    for (const auto& [part, sign] : {std::pair{"Left", -1.0}, {"Right", 1.0}}) {
      if (joint.name == part + std::string("ForeArm") || joint.name == part + std::string("Hand"))
        joint.offset = rotated(about({0, 0, 1}, 0.8 * sign), joint.offset);
    }
  }
  a_pose.pose = [](int f) {
    std::map<std::string, Quat> pose = MadePerson::walk(f);
    pose["LeftArm"] = about({0, 0, 1}, -0.6), pose["RightArm"] = about({0, 0, 1}, 0.6);
    return pose;
  };
  const Read seen_a = read(a_pose);
  EXPECT_TRUE(seen_a.says("T-pose from the zero pose")) << seen_a.summary << seen_a.error;
  const auto joints = joints_of(shipped_body(), seen_a.clip, 9);
  EXPECT_NEAR(bone(joints, kLeftShoulder, kLeftElbow).y, -std::sin(1.4), 0.01);
}

TEST(ClipNeutral, AnyFrameMayBeTheTPose) {
  MadePerson person;  // bent, but for one frame
  person.t_pose_first = false;
  person.pose = [](int f) {
    std::map<std::string, Quat> pose = MadePerson::walk(f);
    if (f == 7) return std::map<std::string, Quat>{};
    pose["Spine"] = about({1, 0, 0}, 0.5);
    return pose;
  };
  const Read seventh =
                 read(person, {.neutral = Neutral::kFrame, .neutral_frame = 7, .smooth_s = 0}),
             zero = read(person, {.neutral = Neutral::kZeroPose, .smooth_s = 0});
  EXPECT_TRUE(seventh.says("T-pose from frame 7, ")) << seventh.summary << seventh.error;
  EXPECT_LT(apart(seventh.clip, zero.clip), 1e-5);
  EXPECT_TRUE(read(person, {.neutral = Neutral::kFrame, .neutral_frame = 20})
                  .fails("neutral: frame 20: the clip has 20 frames"));
}

TEST(ClipRates, NoFrameIsLostToMissingDigits) {
  for (const auto& [time, frames] : {std::pair{"0.0333333", 19u},
                                     {"0.033333333333", 19u},
                                     {"0.03333", 19u},
                                     {"0.033334", 19u},
                                     {"0.0166667", 10u},
                                     {"0.016667", 10u},
                                     {"0.008333", 5u},
                                     {"0.0416667", 23u}}) {
    MadePerson person;
    person.frame_time = time;
    EXPECT_EQ(read(person).clip.frame_count, frames) << time;
  }
  EXPECT_EQ(read(MadePerson(), {.frames_per_second = 24}).clip.frame_count, 15u);
  EXPECT_EQ(read(MadePerson(), {.frames_per_second = 25}).clip.frame_count, 16u);
  MadePerson person;
  person.frame_time = "33.3";  // milliseconds
  EXPECT_TRUE(read(person).fails("--source-fps gives the rate"));
  EXPECT_EQ(read(person, {.source_fps = 30}).clip.frame_count, 19u);
}

TEST(ClipChecks, WhatCannotBeAPersonIsRefused) {
  MadePerson person;
  for (tests::MadeJoint& joint : person.joints) {
    if (joint.name.ends_with("ForeArm")) joint.offset *= 3.0;
  }
  EXPECT_TRUE(read(person).fails("upper arm is ")) << read(person).error;
  EXPECT_TRUE(read(person, {.checked = false}).says("upper arm) of the body's"));
  // Inches, metres, a doll: the size of the whole does not matter.
  for (const double scale : {0.01, 0.39, 10.0}) {
    MadePerson sized;
    sized.scale = scale;
    EXPECT_LT(apart(read(sized).clip, read(MadePerson()).clip), 2e-3) << scale;
  }
}

TEST(ClipSmoothing, ASpinKeepsItsSpeed) {
  for (const double degrees : {1.0, 5.0, 7.0, 20.0}) {
    RetargetSource source;
    source.where = "spin";
    source.frames_per_second = 120;
    source.frames = 600;
    source.leg = 1;
    source.driven[kPelvis] = true;
    source.world_from_neutral.assign(600 * kJointCount, no_turn());
    source.hips.assign(600, Vec3(0, 1, 0));
    for (int f = 0; f < 600; ++f) {
      source.world_from_neutral[static_cast<size_t>(f) * kJointCount] =
          about({0, 1, 0}, f * degrees / 180 * std::numbers::pi);
    }
    const Result<MotionClip> clip =
        retarget(source, shipped_body(), {.frames_per_second = 120, .smooth_s = 0.5f}, 0, nullptr);
    ASSERT_TRUE(clip.ok());
    double worst = 0;
    for (uint32_t f = 1; f < clip->frame_count; ++f) {
      const auto at = [&](uint32_t frame) {
        const float* q = &clip->rotations[size_t{frame} * kJointCount * 4];
        return Quat(q[0], q[1], q[2], q[3]);
      };
      const double step = angle_between(unit(at(f)), unit(at(f - 1))) * 180 / std::numbers::pi;
      worst = std::max(worst, std::abs(step - degrees));
    }
    std::printf("spin of %g degrees a frame: %.5f degrees off at worst\n", degrees, worst);
    EXPECT_LT(worst, 0.05) << degrees;
  }
}

// SMPL's parameters of a walk: upright by a turn about x where z is up.
struct Smpl {
  size_t frames = 12;
  double root = kRight;

  std::vector<double> rotations(size_t joints, size_t first = 0) const {
    std::vector<double> out(frames * joints * 3, 0.0);
    for (size_t f = 0; f < frames; ++f) {
      const auto set = [&](size_t joint, size_t axis, double value) {
        if (joint >= first && joint < first + joints)
          out[(f * joints + joint - first) * 3 + axis] = value;
      };
      set(kPelvis, 0, root);
      set(kLeftShoulder, 2, -1.3);
      set(kRightShoulder, 2, 1.3);
      set(kLeftHip, 0, 0.3 * std::sin(0.6 * double(f)));
      set(kRightHip, 0, -0.3 * std::sin(0.6 * double(f)));
    }
    return out;
  }
  std::vector<double> trans() const {
    std::vector<double> out;
    for (size_t f = 0; f < frames; ++f) out.insert(out.end(), {0, -0.05 * double(f), 0.95});
    return out;
  }
  std::map<std::string, std::string> file(size_t columns = 165) const {
    return {{"poses", npy_bytes("<f8", {frames, columns}, rotations(columns / 3))},
            {"trans", npy_bytes("<f8", {frames, 3}, trans())},
            {"mocap_frame_rate", npy_bytes("<f8", {}, {30})}};
  }
};

Read read(const std::map<std::string, std::string>& arrays, const RetargetOptions& options = {}) {
  return read(tests::stored_npz(arrays), ClipKind::kNpz, options);
}

TEST(SmplFiles, EveryLayoutIsTheSameMotion) {
  const Smpl smpl;
  const MotionClip whole = read(smpl.file()).clip;
  ASSERT_EQ(whole.frame_count, 12u);
  EXPECT_LT(lean(whole), 10);
  const auto same = [&](const std::map<std::string, std::string>& arrays, const std::string& what,
                        bool hands = true) {
    const Read other = read(arrays);
    ASSERT_EQ(other.error, "") << what;
    double largest = 0;
    for (uint32_t f = 0; f < 12; ++f) {
      const auto one = joints_of(shipped_body(), whole, f),
                 two = joints_of(shipped_body(), other.clip, f);
      const size_t joints = hands ? size_t{kJointCount} : size_t{kJaw};
      for (size_t j = 0; j < joints; ++j) largest = std::max(largest, length(one[j] - two[j]));
    }
    EXPECT_LT(largest, 1e-4) << what;
  };
  same(smpl.file(156), "SMPL-H");
  same(smpl.file(72), "SMPL", false);
  same(smpl.file(66), "body", false);
  auto arrays = smpl.file();
  arrays["poses"] = npy_bytes("<f8", {12, 55, 3}, smpl.rotations(55));
  same(arrays, "[F,55,3]");
  arrays["poses"] = npy_bytes("<f4", {1, 12, 24, 3}, smpl.rotations(24));
  same(arrays, "[1,F,24,3]", false);
  arrays["poses"] = npy_bytes(">f4", {12, 52, 3}, smpl.rotations(52));
  same(arrays, "big-endian [F,52,3]");
  arrays.erase("poses");
  arrays["fullpose"] = npy_bytes("<f8", {12, 165}, smpl.rotations(55));
  same(arrays, "fullpose");
  // Matrices.
  std::vector<double> matrices;
  const std::vector<double> turns = smpl.rotations(24);
  for (size_t i = 0; i < turns.size(); i += 3) {
    const Vec3 v(turns[i], turns[i + 1], turns[i + 2]);
    const Mat3 m = matrix_of(length(v) > 0 ? about(unit(v), length(v)) : no_turn());
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) matrices.push_back(m[column][row]);
    }
  }
  arrays.erase("fullpose");
  arrays["pose"] = npy_bytes("<f8", {12, 24, 3, 3}, matrices);
  same(arrays, "[F,24,3,3]", false);
  // One array a part, under either set of names; the rate in an array of one, places as [F,1,3].
  arrays.erase("pose");
  arrays["root_orient"] = npy_bytes("<f8", {12, 3}, smpl.rotations(1));
  arrays["pose_body"] = npy_bytes("<f8", {12, 63}, smpl.rotations(21, 1));
  same(arrays, "split", false);
  arrays["pose_hand"] = npy_bytes("<f8", {12, 90}, std::vector<double>(12 * 90));
  arrays["pose_jaw"] = npy_bytes("<f8", {12, 3}, std::vector<double>(36));
  arrays["pose_eye"] = npy_bytes("<f8", {12, 6}, std::vector<double>(72));
  same(arrays, "split, hands");
  same({{"global_orient", npy_bytes("<f4", {12, 1, 3}, smpl.rotations(1))},
        {"body_pose", npy_bytes("<f4", {12, 23, 3}, smpl.rotations(23, 1))},
        {"transl", npy_bytes("<f4", {12, 1, 3}, smpl.trans())},
        {"fps", npy_bytes("<i8", {1}, {30})}},
       "of a video", false);
}

TEST(SmplFiles, TypesOfSixteenBits) {
  Smpl smpl;
  smpl.root = 0;
  auto arrays = smpl.file();
  arrays["poses"] = npy_bytes("<f2", {12, 66}, std::vector<double>(12 * 66));
  std::vector<double> ones(36, 0.0);
  for (size_t f = 6; f < 12; ++f) ones[3 * f] = 1;
  arrays["trans"] = npy_bytes("<f2", {12, 3}, ones);
  const Read half = read(arrays, {.smooth_s = 0});
  ASSERT_EQ(half.error, "");
  EXPECT_TRUE(half.says("up y"));
  EXPECT_NEAR(half.clip.root_translation_m[33], leg_length_m(shipped_body()) / 0.79, 1e-3);
}

TEST(SmplFiles, EveryUpAxisIsSeen) {
  for (const auto& [root, up] :
       {std::pair{0.0, "y"}, {kRight, "z"}, {-kRight, "-z"}, {2 * kRight, "-y"}}) {
    Smpl smpl;
    smpl.root = root;
    auto arrays = smpl.file();
    arrays.erase("trans");  // what tools that see one person leave out
    const Read seen = read(arrays);
    EXPECT_TRUE(seen.says(std::string("up ") + up)) << seen.summary << seen.error;
    EXPECT_TRUE(seen.says("no trans: stays in its place"));
    EXPECT_LT(lean(seen.clip), 10);
  }
}

TEST(SmplFiles, PlacesInCentimetresAreNoticed) {
  Smpl smpl;
  smpl.frames = 30;
  auto arrays = smpl.file();
  std::vector<double> places = smpl.trans();
  for (double& value : places) value *= 100;
  arrays["trans"] = npy_bytes("<f8", {30, 3}, places);
  EXPECT_TRUE(read(arrays).fails("the hips are 145.00 m away within 1.00 s")) << read(arrays).error;
  EXPECT_EQ(read(arrays, {.checked = false}).error, "");
}

TEST(SmplFiles, WhatIsWrongIsNamed) {
  const Smpl smpl;
  const auto error = [&](const std::string& name, const std::string& array) {
    auto arrays = smpl.file();
    arrays[name] = array;
    if (array.empty()) arrays.erase(name);
    return read(arrays).error;
  };
  EXPECT_EQ(error("poses", npy_bytes("<f8", {12, 75}, std::vector<double>(12 * 75))),
            "clip: poses: 75 columns, expected 165 (SMPL-X), 156 (SMPL-H), 72 (SMPL) or 66 (body), "
            "or these as joints");
  EXPECT_EQ(error("poses", ""), "clip: poses: no such array, and no root_orient or global_orient");
  EXPECT_EQ(error("trans", npy_bytes("<f8", {11, 3}, std::vector<double>(33))),
            "clip: trans: shape (11,3), expected (12,3)");
  EXPECT_EQ(error("poses", npy_bytes("<f8", {12, 66}, std::vector<double>(12 * 66, NAN))),
            "clip: poses: a value is not finite or out of range");
  EXPECT_EQ(error("mocap_frame_rate", npy_bytes("<f8", {}, {0})),
            "clip: mocap_frame_rate: not within 1 and 1000; --source-fps gives the rate");
  EXPECT_EQ(error("mocap_frame_rate", "").rfind("clip: mocap_frame_rate: no such array", 0), 0u);
  EXPECT_EQ(error("poses", npy_bytes("<f8", {12, 22, 3, 3}, std::vector<double>(12 * 198, 1.0))),
            "clip: poses: matrix 0 is no rotation");
  EXPECT_EQ(read("PK", ClipKind::kNpz).error.rfind("clip: not a readable .npz: ", 0), 0u);
  // Judged by what it declares, before it is unpacked.
  std::string bomb = npy_bytes("|u1", {1}, {});
  bomb.replace(bomb.find("(1,)"), 4, "(99999999999,3)");
  EXPECT_TRUE(read({{"poses", bomb}}).fails("more than 2^26 values"));
}

std::string as_gltf(const tests::GlbBuilder& glb) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < glb.bin.size(); i += 3) {
    uint32_t word = 0;
    const size_t left = std::min<size_t>(3, glb.bin.size() - i);
    for (size_t k = 0; k < 3; ++k)
      word = word << 8 | (k < left ? static_cast<uint8_t>(glb.bin[i + k]) : 0);
    for (size_t k = 0; k < 4; ++k) text += k <= left ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  nlohmann::json whole = glb.json;
  whole["buffers"] = {
      {{"byteLength", glb.bin.size()}, {"uri", "data:application/octet-stream;base64," + text}}};
  return whole.dump(2);
}

tests::GlbBuilder made_glb() {
  tests::GlbBuilder glb;
  std::vector<int> nodes;
  for (const tests::MadeJoint& joint : tests::made_skeleton()) {
    const Vec3 place = 0.01 * joint.offset;
    nodes.push_back(glb.node("mixamorig:" + joint.name,
                             joint.parent < 0 ? -1 : nodes[static_cast<size_t>(joint.parent)],
                             {{"translation", {place.x, place.y, place.z}}}));
  }
  std::vector<float> times, turns;
  for (int f = 0; f < 20; ++f) {
    times.push_back(static_cast<float>(f) / 30);
    const Quat q = about({0, 0, 1}, -0.07 * f);
    for (const double v : {q.x, q.y, q.z, q.w}) turns.push_back(static_cast<float>(v));
  }
  glb.track(nodes[11], "rotation", "LINEAR", times, turns);
  return glb;
}

TEST(GltfFiles, JsonWithDataUrisIsTheBinaryFile) {
  const tests::GlbBuilder glb = made_glb();
  const Read binary = read(glb.file(), ClipKind::kGltf), json = read(as_gltf(glb), ClipKind::kGltf);
  ASSERT_EQ(binary.error, "");
  ASSERT_EQ(json.error, "");
  EXPECT_EQ(binary.clip.rotations, json.clip.rotations);
  EXPECT_EQ(json.clip.frame_count, 20u);
  nlohmann::json other = glb.json;
  other["buffers"] = {{{"byteLength", glb.bin.size()}, {"uri", "walk.bin"}}};
  EXPECT_TRUE(read(other.dump(), ClipKind::kGltf)
                  .fails("buffers[0].uri: unsupported: \"walk.bin\": no other file is opened"));
}

TEST(GltfFiles, OtherNodesAndAnimationsDoNotMatter) {
  const MotionClip plain = read(made_glb().file(), ClipKind::kGltf).clip;
  tests::GlbBuilder glb = made_glb();
  const int prop =
      glb.node("prop", -1, {{"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}});
  glb.node("child", prop, {{"scale", {1, -1, 1}}});
  glb.track(prop, "translation", "LINEAR", {0, 9}, {0, 0, 0, 1, 1, 1});  // has a matrix: no keys
  const Read beside = read(glb.file(), ClipKind::kGltf);
  ASSERT_EQ(beside.error, "");
  EXPECT_EQ(beside.clip.rotations, plain.rotations);
  // A camera's animation first: the person's is taken, and said; asked for, the first is refused.
  tests::GlbBuilder two = made_glb();
  const int camera = two.node("Camera", -1);
  nlohmann::json first = two.json["animations"][0];
  first["channels"][0]["target"]["node"] = camera;
  first["channels"][0]["target"]["path"] = "rotation";
  two.json["animations"].insert(two.json["animations"].begin(), first);
  const Read second = read(two.file(), ClipKind::kGltf);
  EXPECT_TRUE(second.says("animation 1 is the first that moves the skeleton")) << second.error;
  EXPECT_EQ(second.clip.rotations, plain.rotations);
  EXPECT_TRUE(read(two.file(), ClipKind::kGltf, {.animation = 0})
                  .fails("animations[0]: moves none of the skeleton's joints"));
}

TEST(ClipNames, EndingsInAnyCaseOfLetters) {
  for (const auto& [name, kind] : {std::pair{"a.BVH", ClipKind::kBvh},
                                   {"b.Npz", ClipKind::kNpz},
                                   {"c.GLB", ClipKind::kGltf},
                                   {"d.vrma", ClipKind::kGltf},
                                   {"e.glTF", ClipKind::kGltf},
                                   {"f.FGN", ClipKind::kPackage}}) {
    ASSERT_TRUE(clip_kind(name).ok()) << name;
    EXPECT_EQ(*clip_kind(name), kind) << name;
  }
  EXPECT_EQ(clip_kind("a.fbx").status().code(), StatusCode::kUnsupported);
}

TEST(ClipSources, AUsersClipIsTheUsers) {
  EXPECT_EQ(*clip_source(tests::case_path("bvh-reference/in.bvh")), "in.bvh: supplied by the user");
  EXPECT_EQ(*clip_source(tests::case_path("glb-reference/in.glb")), "in.glb: supplied by the user");
  EXPECT_EQ(*clip_source(tests::case_path("npz-smplx/in.npz")), "in.npz: supplied by the user");
  EXPECT_NE(clip_source(FIGURINE_SOURCE_DIR "/samples/packages/walk.fgn")->find("mocap.cs.cmu.edu"),
            std::string::npos);
}

TEST(ImportOptions, SayWhatIsWrongWithThem) {
  ImportSettings settings;
  const auto set = [&](const std::string& name, const std::string& text) {
    for (const TextOption& option : import_options(settings)) {
      if (option.name == name) return option.set(text).message();
    }
    return std::string("no such option");
  };
  EXPECT_EQ(set("--fps", "24"), "");
  EXPECT_EQ(settings.retarget.frames_per_second, 24);
  EXPECT_EQ(set("--fps", "0"), "'0': not a number from 1 to 240");
  EXPECT_EQ(set("--fps", "24x"), "'24x': not a number from 1 to 240");
  EXPECT_EQ(set("--up", "-z"), "");
  EXPECT_EQ(settings.retarget.up, ClipUp::kMinusZ);
  EXPECT_EQ(set("--up", "w"), "'w': none of y, z, x, -y, -z and -x");
  EXPECT_EQ(set("--neutral", "second"), "'second': neither first, zero, axes nor a frame's number");
  EXPECT_EQ(set("--head-pitch", "-20"), "");
  EXPECT_EQ(settings.head_pitch_deg, -20);
  EXPECT_EQ(set("--start", "-1"), "'-1': not a frame's number");
  EXPECT_EQ(set("--no-checks", ""), "");
  EXPECT_FALSE(settings.retarget.checked);
  EXPECT_EQ(set("--map", ""), "empty");
}

}  // namespace
}  // namespace figurine::ports::clip_kinds_test
