// The names that tools give joints: each naming finds all of them, and says what it does not find.
#include "ports/motion/joint_names.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "ports/motion/made_person.h"

namespace figurine::ports::joint_names_test {
namespace {

struct Tree {
  std::vector<std::string> names;
  std::vector<int> parents;
  std::vector<bool> moved;
  std::vector<std::pair<std::string, uint32_t>> human_bones;

  Result<JointNodes> find(const JointMap& map = {}) const {
    return find_joints({.where = "a",
                        .names = names,
                        .parents = parents,
                        .moved = moved,
                        .human_bones = human_bones},
                       map);
  }
  void add(const std::string& name, int parent, bool moves = true) {
    names.push_back(name);
    parents.push_back(parent);
    moved.push_back(moves);
  }
};

Tree named(const std::function<std::string(const std::string&)>& name) {
  Tree tree;
  for (const tests::MadeJoint& joint : tests::made_skeleton())
    tree.add(name(joint.name), joint.parent);
  return tree;
}

// Which of the 55 the joints of made_skeleton() are, in its order.
const std::vector<int>& wanted() {
  static const std::vector<int> joints = {
      kPelvis,      kSpine1,        kSpine2,     kSpine3,    kNeck,       kHead,
      kLeftHip,     kLeftKnee,      kLeftAnkle,  kLeftFoot,  kLeftCollar, kLeftShoulder,
      kLeftElbow,   kLeftWrist,     kRightHip,   kRightKnee, kRightAnkle, kRightFoot,
      kRightCollar, kRightShoulder, kRightElbow, kRightWrist};
  return joints;
}

void expect_found(const Tree& tree, const std::string& what, int first = 0) {
  const Result<JointNodes> joints = tree.find();
  ASSERT_TRUE(joints.ok()) << what << ": " << joints.status().message();
  for (size_t i = 0; i < wanted().size(); ++i) {
    EXPECT_EQ(joints->node[static_cast<size_t>(wanted()[i])], first + static_cast<int>(i))
        << what << ": " << joint_names()[static_cast<size_t>(wanted()[i])];
  }
}

// A naming by its words: HumanIK's to another's, the side behind or before.
std::function<std::string(const std::string&)> naming(
    const std::map<std::string, std::string>& words,
    const std::function<std::string(const std::string& side, const std::string& word)>& join) {
  return [=](const std::string& name) {
    const std::string side = name.starts_with("Left")    ? "Left"
                             : name.starts_with("Right") ? "Right"
                                                         : "";
    const std::string part = name.substr(side.size());
    const auto word = words.find(part);
    return join(side, word == words.end() ? part : word->second);
  };
}

std::string before(const std::string& side, const std::string& word) { return side + word; }
std::string letter(const std::string& side) { return side.substr(0, 1); }

TEST(JointNames, EveryNamingIsKnown) {
  expect_found(named([](const std::string& n) { return n; }), "HumanIK");
  expect_found(named([](const std::string& n) { return "mixamorig:" + n; }), "Mixamo");
  expect_found(named([](const std::string& n) { return "mixamorig" + n; }), "Mixamo, no colon");
  expect_found(named([](const std::string& n) { return "mixamorig7:" + n; }), "Mixamo, numbered");
  expect_found(named([](const std::string& n) { return "Armature|mixamorig_" + n; }), "bar");
  expect_found(named([](const std::string& n) { return "Character1_" + n; }), "a character");
  expect_found(named([](const std::string& n) { return n + ".001"; }), "Blender's copies");
  expect_found(named([](const std::string& n) { return "mixamorig:" + n + "_042"; }), "numbered");
  expect_found(named([](std::string n) {
                 for (char& c : n) c = static_cast<char>(std::tolower(c));
                 return n;
               }),
               "small letters");
  expect_found(named(naming({{"ToeBase", "Toe"}}, before)), "LaFAN");
  expect_found(named(naming({{"UpLeg", "Thigh"}, {"Leg", "Shin"}, {"ToeBase", "Toe"}}, before)),
               "Rokoko");
  const std::map<std::string, std::string> vrm = {
      {"UpLeg", "UpperLeg"},   {"Leg", "LowerLeg"}, {"ToeBase", "Toes"},     {"Arm", "UpperArm"},
      {"ForeArm", "LowerArm"}, {"Spine1", "Chest"}, {"Spine2", "UpperChest"}};
  expect_found(named(naming(vrm, before)), "VRM");
  expect_found(named(naming(vrm,
                            [](const std::string& side, const std::string& word) {
                              return "J_Bip_" + (side.empty() ? "C" : letter(side)) + "_" + word;
                            })),
               "VRoid");
  const std::map<std::string, std::string> biped = {
      {"Hips", "Pelvis"},       {"UpLeg", "Thigh"},  {"Leg", "Calf"},       {"ToeBase", "Toe0"},
      {"Shoulder", "Clavicle"}, {"Arm", "UpperArm"}, {"ForeArm", "Forearm"}};
  expect_found(named(naming(biped,
                            [](const std::string& side, const std::string& word) {
                              return "Bip01 " + (side.empty() ? "" : letter(side) + " ") + word;
                            })),
               "Rocketbox");
  std::map<std::string, std::string> unreal = biped;
  unreal["ToeBase"] = "ball", unreal["ForeArm"] = "lowerarm";
  unreal["Spine"] = "spine_01", unreal["Spine1"] = "spine_02", unreal["Spine2"] = "spine_03";
  unreal["Neck"] = "neck_01";
  expect_found(named(naming(unreal,
                            [](const std::string& side, const std::string& word) {
                              return word + (side.empty() ? "" : side == "Left" ? "_l" : "_r");
                            })),
               "Unreal");
  expect_found(named(naming({{"UpLeg", "thigh"}, {"Leg", "shin"}, {"Arm", "upper_arm"}},
                            [](const std::string& side, const std::string& word) {
                              return word + (side.empty() ? "" : "." + letter(side)) + ".002";
                            })),
               "Blender");
  const std::map<std::string, std::string> smpl = {
      {"Hips", "Pelvis"},  {"UpLeg", "Hip"},       {"Leg", "Knee"},      {"Foot", "Ankle"},
      {"ToeBase", "Foot"}, {"Shoulder", "Collar"}, {"Arm", "Shoulder"},  {"ForeArm", "Elbow"},
      {"Hand", "Wrist"},   {"Spine", "Spine1"},    {"Spine1", "Spine2"}, {"Spine2", "Spine3"}};
  expect_found(named(naming(smpl,
                            [](const std::string& side, const std::string& word) {
                              return (side.empty() ? "" : letter(side) + "_") + word;
                            })),
               "SMPL");
  std::map<std::string, std::string> xsens = smpl;
  xsens["Hips"] = "Hips", xsens["ToeBase"] = "Toe";
  xsens["Spine"] = "Chest", xsens["Spine1"] = "Chest2", xsens["Spine2"] = "Chest3";
  expect_found(named(naming(xsens, before)), "Xsens");
  const std::map<std::string, std::string> poser = {
      {"Hips", "hip"},      {"UpLeg", "Thigh"},     {"Leg", "Shin"},
      {"ToeBase", "Toe"},   {"Shoulder", "Collar"}, {"Arm", "Shldr"},
      {"Spine", "abdomen"}, {"Spine1", "abdomen2"}, {"Spine2", "chest"}};
  expect_found(named(naming(poser,
                            [](const std::string& side, const std::string& word) {
                              return (side.empty() ? "" : side == "Left" ? "l" : "r") + word;
                            })),
               "Poser");
  const std::map<std::string, std::string> mmd = {
      {"UpLeg", " leg"},   {"Leg", " knee"},          {"Foot", " ankle"},    {"ToeBase", " toe"},
      {"Arm", " arm"},     {"Shoulder", " shoulder"}, {"ForeArm", " elbow"}, {"Hand", " wrist"},
      {"Spine1", "Chest"}, {"Spine2", "Upper Chest"}};
  expect_found(named(naming(mmd, before)), "MMD");
}

TEST(JointNames, VrmSaysItsBonesItself) {
  Tree tree = named([](const std::string& n) { return "bone of " + n.substr(n.size() - 1); });
  const char* bones[] = {"hips", "spine", "chest", "upperChest", "neck", "head"};
  const char* sides[] = {"UpperLeg", "LowerLeg", "Foot",     "Toes",
                         "Shoulder", "UpperArm", "LowerArm", "Hand"};
  for (uint32_t i = 0; i < 6; ++i) tree.human_bones.emplace_back(bones[i], i);
  for (uint32_t i = 0; i < 16; ++i)
    tree.human_bones.emplace_back((i < 8 ? "left" : "right") + std::string(sides[i % 8]), 6 + i);
  expect_found(tree, "VRM");
}

TEST(JointNames, TheSkeletonThatMovesIsTaken) {
  for (const bool first_moves : {true, false}) {
    Tree tree;
    for (int copy = 0; copy < 2; ++copy) {
      const int first = static_cast<int>(tree.names.size());
      for (const tests::MadeJoint& joint : tests::made_skeleton()) {
        tree.add(joint.name + (copy == 1 ? ".001" : ""),
                 joint.parent < 0 ? -1 : first + joint.parent, (copy == 0) == first_moves);
      }
    }
    expect_found(tree, "two", first_moves ? 0 : 22);
  }
  // Both: said.
  Tree both;
  for (int copy = 0; copy < 2; ++copy) {
    for (const tests::MadeJoint& joint : tests::made_skeleton())
      both.add(joint.name, joint.parent < 0 ? -1 : 22 * copy + joint.parent);
  }
  const Result<JointNodes> joints = both.find();
  ASSERT_TRUE(joints.ok());
  EXPECT_EQ(joints->note, "2 skeletons move, taken is that of 'Hips'");
}

TEST(JointNames, NodesBesideTheSkeletonDoNotMatter) {
  Tree tree = named([](const std::string& n) { return n; });
  tree.names.insert(tree.names.begin(), "Head");  // a mesh, before the skeleton
  for (int& parent : tree.parents) parent += parent >= 0;
  tree.parents.insert(tree.parents.begin(), -1);
  tree.moved.insert(tree.moved.begin(), true);
  expect_found(tree, "a mesh called Head", 1);
}

TEST(JointNames, ASpineBesideTheHipsIsASpine) {
  // Character Creator: hips and waist below one node.
  Tree tree = named([](const std::string& n) { return n; });
  tree.add("Root", -1);
  tree.parents[0] = tree.parents[1] = 22;
  expect_found(tree, "side by side");
}

TEST(JointNames, ALoneFingerJointIsNoFinger) {
  Tree tree = named([](const std::string& n) { return n; });
  tree.add("LeftHandIndex1", 13);
  tree.add("RightHandIndex1", 21);
  tree.add("RightHandIndex2", 23);
  const Result<JointNodes> joints = tree.find();
  ASSERT_TRUE(joints.ok());
  EXPECT_FALSE(joints->has(kLeftIndex1));
  EXPECT_EQ(joints->at(kRightIndex1), 23u);
  EXPECT_EQ(joints->at(kRightIndex1 + 1), 24u);
}

TEST(JointNames, WhatIsMissingIsNamedWithTheNearest) {
  Tree tree = named([](const std::string& n) { return n == "LeftLeg" ? "LftLeg" : n; });
  EXPECT_EQ(tree.find().status().message().rfind(
                "a: no joint left_knee (leftleg); nearest: 'LftLeg', ", 0),
            0u)
      << tree.find().status().message();
  EXPECT_NE(tree.find().status().message().find("--map FILE"), std::string::npos);
  const Result<JointNodes> mapped = tree.find({{"left_knee", "LftLeg"}});
  ASSERT_TRUE(mapped.ok()) << mapped.status().message();
  EXPECT_EQ(mapped->at(kLeftKnee), 7u);
  EXPECT_EQ(tree.find({{"left_knee", "LftLog"}})
                .status()
                .message()
                .rfind("a: --map: left_knee: there is no 'LftLog'; nearest: 'LftLeg', ", 0),
            0u);
  Tree strange = named([](const std::string& n) { return "Q" + std::to_string(n.size()); });
  EXPECT_NE(strange.find().status().message().find("no joint has a known name"), std::string::npos);
  EXPECT_FALSE(Tree{}.find().ok());
}

TEST(JointNames, AMapIsJson) {
  const auto error = [](const char* text) {
    return parse_joint_map(text, "m.json").status().message();
  };
  EXPECT_EQ((*parse_joint_map("{\"neck\": \"Hals\"}", "m.json")).at("neck"), "Hals");
  EXPECT_EQ(error("{"), "m.json: JSON: not valid at byte 2");
  EXPECT_EQ(error("[]").rfind("m.json: not an object of joints and names", 0), 0u);
  EXPECT_EQ(error("{\"left_knea\": \"x\"}")
                .rfind("m.json: 'left_knea' is no joint; nearest: 'left_knee'", 0),
            0u);
  EXPECT_EQ(error("{\"neck\": 5}"), "m.json: neck: not a name");
}

}  // namespace
}  // namespace figurine::ports::joint_names_test
