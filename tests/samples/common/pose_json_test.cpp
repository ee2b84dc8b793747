// Poses as text: what is written reads back to the bit, both ways to say a rotation mean the same,
// and every wrong text gets one line that names the field.
#include "samples/common/pose_json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace figurine::samples::pose_json_test {
namespace {

const std::vector<std::string> kNames = {"pelvis", "left_elbow", "right_elbow", "neck", "head"};

std::string reason(const std::string& text) {
  const Result<StoredPose> pose = parse_pose_json(text, kNames, "x.json");
  EXPECT_FALSE(pose.ok()) << text;
  if (pose.ok()) return "";
  EXPECT_EQ(pose.status().message().find('\n'), std::string::npos);
  EXPECT_EQ(pose.status().message().rfind("x.json: ", 0), 0u) << pose.status().message();
  return pose.status().message();
}

void expect_refused(const std::string& text, const std::string& why) {
  EXPECT_NE(reason(text).find(why), std::string::npos) << text << "\n" << reason(text);
}

TEST(PoseJson, MissingJointsAreAtRest) {
  const Result<StoredPose> pose =
      parse_pose_json(R"({"joints": {"neck": [0, 0, 1, 0]}})", kNames, "x.json");
  ASSERT_TRUE(pose.ok()) << pose.status().message();
  const std::vector<float> expected = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0};
  EXPECT_EQ(pose->rotations, expected);
  EXPECT_EQ(pose->root_translation_m, (std::array<float, 3>{0, 0, 0}));
  EXPECT_EQ(parse_pose_json("{}", kNames, "x.json")->rotations, rest_pose(5).rotations);
}

TEST(PoseJson, AnAxisTimesItsAngleIsTheQuaternion) {
  const Result<StoredPose> pose = parse_pose_json(
      R"({"root_translation_m": [1, -2.5, 3e-1],
          "joints": {"left_elbow": [0, -1.5707963267948966, 0], "head": [0, 0, 0]}})",
      kNames, "x.json");
  ASSERT_TRUE(pose.ok()) << pose.status().message();
  const float half = static_cast<float>(std::sqrt(0.5));
  const float expected[] = {half, 0, -half, 0, 1, 0, 0, 0};
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(pose->rotations[4 + k], expected[k], 1e-7) << k;
    EXPECT_EQ(pose->rotations[16 + k], expected[4 + k]) << k;
  }
  EXPECT_EQ(pose->root_translation_m, (std::array<float, 3>{1, -2.5f, 0.3f}));
}

TEST(PoseJson, WhatIsWrittenReadsBackToTheBit) {
  uint32_t state = 7;
  const auto next = [&] { return (state = state * 1664525u + 1013904223u); };
  for (int round = 0; round < 200; ++round) {
    StoredPose pose;
    for (float& value : pose.root_translation_m)
      value = std::ldexp(static_cast<float>(next() >> 8) - 0x1p23f, -21);
    for (size_t i = 0; i < 4 * kNames.size(); ++i)
      pose.rotations.push_back(std::ldexp(static_cast<float>(next() >> 8) - 0x1p23f, -23));
    pose.rotations[3] = 1e-30f;
    const std::string text = write_pose_json(pose.view(), kNames);
    const Result<StoredPose> back = parse_pose_json(text, kNames, "x.json");
    ASSERT_TRUE(back.ok()) << back.status().message();
    EXPECT_EQ(back->root_translation_m, pose.root_translation_m);
    EXPECT_EQ(back->rotations, pose.rotations) << text;
  }
}

TEST(PoseJson, NamesOfEveryKindSurvive) {
  const std::vector<std::string> odd = {"a\"b", "tab\there", "\xC3\xA9paule"};
  const StoredPose pose = rest_pose(3);
  const Result<StoredPose> back = parse_pose_json(write_pose_json(pose.view(), odd), odd, "x.json");
  ASSERT_TRUE(back.ok()) << back.status().message();
}

TEST(PoseJson, AnUnknownNameIsToldTheNearest) {
  expect_refused(
      R"({"joints": {"left_elbwo": [1, 0, 0, 0]}})",
      "joint 'left_elbwo': there is none of this name; nearest: left_elbow, right_elbow");
  expect_refused(R"({"joints": {"HEAD": [1, 0, 0, 0]}})", "nearest: head");
  expect_refused(R"({"joints": {"tail_of_a_lizard": [1, 0, 0, 0]}})", "'tail_of_a_lizard'");
  expect_refused(R"({"joint": {}})", "field 'joint': there is none of this name; nearest: joints");
  // Nothing from outside reaches a terminal as it came.
  EXPECT_EQ(reason("{\"joints\": {\"\\u001b[2J\": [1, 0, 0, 0]}}").find('\x1b'), std::string::npos);
  EXPECT_LT(reason("{\"" + std::string(100000, 'x') + "\": 1}").size(), 300u);
}

TEST(PoseJson, WrongNumbersAreRefused) {
  expect_refused(R"({"joints": {"neck": [0, 0, 0, 0]}})",
                 "joint 'neck': a quaternion of no length");
  expect_refused(R"({"joints": {"neck": [1e-9, 0, 0, 0]}})", "no length");
  expect_refused(R"({"joints": {"neck": [1, 0]}})", "joint 'neck': has 2 numbers");
  expect_refused(R"({"joints": {"neck": [1, 0, 0, 0, 0]}})", "has 5 numbers");
  expect_refused(R"({"joints": {"neck": []}})", "has 0 numbers");
  expect_refused(R"({"joints": {"neck": [1, 0, 0, null]}})", "not a list of numbers");
  expect_refused(R"({"joints": {"neck": ["1", 0, 0, 0]}})", "not a list of numbers");
  expect_refused(R"({"joints": {"neck": 3}})", "not a list of numbers");
  expect_refused(R"({"joints": {"neck": [1e39, 0, 0, 0]}})", "beyond what a float holds");
  expect_refused(R"({"joints": {"neck": [1e7, 0, 0]}})", "a million radians");
  expect_refused(R"({"joints": {"neck": [1e999, 0, 0, 0]}})", "pose: ");
  expect_refused(R"({"joints": {"neck": [NaN, 0, 0, 0]}})", "pose: ");
  expect_refused(R"({"joints": {"neck": [nan, 0, 0, 0]}})", "pose: ");
  expect_refused(R"({"root_translation_m": [0, 0]})", "root_translation_m: has 2 numbers, not 3");
  expect_refused(R"({"root_translation_m": [0, 0, 1e5]})", "beyond 10000 metres");
}

TEST(PoseJson, WrongTextIsRefused) {
  expect_refused("", "pose: ");
  expect_refused("[]", "pose: not a JSON object");
  expect_refused("{", "pose: ");
  expect_refused("{} {}", "pose: ");
  expect_refused(R"({"joints": []})", "joints: not an object");
  expect_refused(R"({"joints": {"neck": [1, 0, 0, 0], "neck": [1, 0, 0, 0]}})",
                 "'neck': is there twice");
  expect_refused(R"({"joints": {}, "joints": {}})", "'joints': is there twice");
  expect_refused("\xFF\xFE", "pose: ");
  expect_refused(std::string(200000, '['), "pose: ");
  const std::string whole = R"({"root_translation_m": [0, 0, 1], "joints": {"neck": [1, 0, 0]}})";
  ASSERT_TRUE(parse_pose_json(whole, kNames, "x.json").ok());
  for (size_t length = 0; length < whole.size(); ++length) reason(whole.substr(0, length));
}

}  // namespace
}  // namespace figurine::samples::pose_json_test
