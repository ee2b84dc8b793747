// Bones onto joints: an unturned sender stands in the T-pose, Unity's rotations turn limbs where
// Unity's manual says, random poses agree with forward kinematics in Unity's own axes by matrices,
// and there and back is the same pose.
#include "ports/vmc/humanoid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "ports/vmc/smplx_figure.h"
#include "ports/vmc/vmc_round_trip.h"

namespace figurine::ports::humanoid_test {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

const tests::SmplxFigure& figure() {
  static const tests::SmplxFigure made;
  return made;
}
const HumanoidRig& rig() {
  static const HumanoidRig made =
      std::move(HumanoidRig::create(figure().names(), figure().rest())).value();
  return made;
}

struct BodyPose {
  std::vector<float> rotations = std::vector<float>(4 * figure().count());
  std::array<float, 3> root_m{};
  std::vector<Affine> world = std::vector<Affine>(figure().count());

  explicit BodyPose(const HumanoidPose& pose) {
    rig().to_body(pose, rotations, root_m);
    EXPECT_TRUE(validate_pose({root_m, rotations}, uint32_t(figure().count())).ok());
    skinning_transforms(figure().rest(), {root_m, rotations}, world);
  }
  glm::dvec3 at(const std::string& joint) const {
    const size_t j = figure().joint(joint);
    const auto p = transform_point(world[j], &figure().rest().rest_position_m[3 * j]);
    return {p[0], p[1], p[2]};
  }
  glm::dvec3 direction(const std::string& from, const std::string& to) const {
    return glm::normalize(at(to) - at(from));
  }
};

// Places are floats near a metre, bones as short as a centimetre: 1e-7 of the one is 1e-5 of the
// other.
constexpr double kTolerance = 5e-5;

void expect_direction(const glm::dvec3& got, const glm::dvec3& wanted, const std::string& what) {
  EXPECT_LT(glm::distance(got, glm::normalize(wanted)), kTolerance) << what;
}

size_t bone(const char* name) { return *humanoid_bone(name); }

// Unity: Quaternion.Euler of a turn about one axis, in Unity's x, y, z, w.
void turn_in_unity(HumanoidPose& pose, const char* name, double x, double y, double z,
                   double degrees) {
  const double half = degrees * 3.14159265358979323846 / 360, s = std::sin(half);
  pose.local[bone(name)] = mirror(glm::dquat(std::cos(half), s * x, s * y, s * z));
}

TEST(Humanoid, HasUnitysBonesInATree) {
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    EXPECT_EQ(humanoid_bone(humanoid_bone_name(b)), b);
    EXPECT_EQ(humanoid_parent(b) < 0, b == 0);
    EXPECT_LT(humanoid_parent(b), static_cast<int>(b));
  }
  EXPECT_EQ(humanoid_bone("leftUPPERarm"), humanoid_bone("LeftUpperArm"));
  EXPECT_EQ(humanoid_bone("LeftUpperAr"), std::nullopt);
  EXPECT_EQ(humanoid_bone(""), std::nullopt);
  size_t with_bone = 0;
  for (size_t j = 0; j < figure().count(); ++j) with_bone += rig().bone_of(j) >= 0;
  EXPECT_EQ(with_bone, figure().count()) << "every joint of SMPL-X has a bone";
}

TEST(Humanoid, AnUnturnedSenderStandsInTheTPose) {
  const BodyPose body{HumanoidPose()};
  for (const double side : {1.0, -1.0}) {
    const std::string s = side > 0 ? "left_" : "right_";
    expect_direction(body.direction(s + "shoulder", s + "elbow"), {side, 0, 0}, s + "upper arm");
    expect_direction(body.direction(s + "elbow", s + "wrist"), {side, 0, 0}, s + "lower arm");
    expect_direction(body.direction(s + "wrist", s + "middle1"), {side, 0, 0}, s + "hand");
    expect_direction(body.direction(s + "pinky1", s + "pinky2"), {side, 0, 0}, s + "little finger");
    expect_direction(body.direction(s + "thumb1", s + "thumb2"), {side, 0, 1}, s + "thumb");
    expect_direction(body.direction(s + "hip", s + "knee"), {0, -1, 0}, s + "thigh");
    expect_direction(body.direction(s + "knee", s + "ankle"), {0, -1, 0}, s + "shank");
    const glm::dvec3 foot = body.direction(s + "ankle", s + "foot");
    EXPECT_NEAR(foot.x, 0, 1e-6);
    EXPECT_GT(foot.z, 0);
    // Soles stay flat: as high above the toes as at rest.
    const auto& rest = figure().rest().rest_position_m;
    EXPECT_NEAR(
        body.at(s + "ankle").y - body.at(s + "foot").y,
        rest[3 * figure().joint(s + "ankle") + 1] - rest[3 * figure().joint(s + "foot") + 1], 1e-6);
  }
  expect_direction(body.direction("spine1", "spine2"), {0, 0.13, 0.01}, "trunk as it stands");
  EXPECT_EQ(body.root_m, (std::array<float, 3>{0, 0, 0}));
}

// Unity's manual: Euler(0, 90, 0) turns forward (z) to the right (x), Euler(90, 0, 0) forward down,
// Euler(0, 0, 90) right up. A figure looks forward, and its left arm is at -x.
TEST(Humanoid, UnitysTurnsGoWhereUnitySays) {
  HumanoidPose bent;
  turn_in_unity(bent, "LeftLowerArm", 0, 1, 0, 90);  // left to forward
  expect_direction(BodyPose(bent).direction("left_elbow", "left_wrist"), {0, 0, 1}, "elbow");
  expect_direction(BodyPose(bent).direction("right_elbow", "right_wrist"), {-1, 0, 0}, "other");

  HumanoidPose lowered;
  turn_in_unity(lowered, "LeftUpperArm", 0, 0, 1, 90);   // left down
  turn_in_unity(lowered, "RightUpperArm", 0, 0, 1, 90);  // right up
  expect_direction(BodyPose(lowered).direction("left_shoulder", "left_wrist"), {0, -1, 0}, "down");
  expect_direction(BodyPose(lowered).direction("right_shoulder", "right_wrist"), {0, 1, 0}, "up");

  HumanoidPose nod;
  turn_in_unity(nod, "Head", 1, 0, 0, 90);  // forward down
  const glm::dvec3 eye = BodyPose(nod).at("left_eye") - BodyPose(nod).at("head");
  EXPECT_NEAR(glm::distance(eye, glm::dvec3(0.03, -0.08, 0.07)), 0, 1e-6) << "eyes look down";

  HumanoidPose look;
  turn_in_unity(look, "Neck", 0, 1, 0, 90);  // forward to Unity's right, the figure's right
  const glm::dvec3 both = BodyPose(look).at("left_eye") + BodyPose(look).at("right_eye") -
                          2.0 * BodyPose(look).at("head");
  EXPECT_LT(both.x, -0.1) << "which is -x of ours";

  HumanoidPose kick;
  turn_in_unity(kick, "RightLowerLeg", 1, 0, 0, 90);  // forward down, so down backward
  expect_direction(BodyPose(kick).direction("right_knee", "right_ankle"), {0, 0, -1}, "knee");
}

// Unity's own forward kinematics, by matrices in its left-handed axes, of a model in the T-pose.
Matrix matrix_of(const glm::dquat& q) {
  const double w = q.w, x = q.x, y = q.y, z = q.z;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}
Matrix times(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      for (size_t k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}
glm::dvec3 times(const Matrix& a, const glm::dvec3& v) {
  return {a[0][0] * v.x + a[0][1] * v.y + a[0][2] * v.z,
          a[1][0] * v.x + a[1][1] * v.y + a[1][2] * v.z,
          a[2][0] * v.x + a[2][1] * v.y + a[2][2] * v.z};
}

TEST(Humanoid, RandomPosesAgreeWithUnitysKinematics) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto rest = figure().rest().rest_position_m;
  const auto rest_direction = [&](const std::string& from, const std::string& to) {
    const size_t a = figure().joint(from), b = figure().joint(to);
    return glm::normalize(glm::dvec3(rest[3 * b] - rest[3 * a], rest[3 * b + 1] - rest[3 * a + 1],
                                     rest[3 * b + 2] - rest[3 * a + 2]));
  };
  double worst = 0;
  for (int round = 0; round < 100; ++round) {
    std::array<glm::dquat, kHumanoidBones> unity;
    HumanoidPose pose;
    std::array<Matrix, kHumanoidBones> world;
    for (size_t b = 0; b < kHumanoidBones; ++b) {
      unity[b] = glm::normalize(
          glm::dquat(normal(random), normal(random), normal(random), normal(random)));
      pose.local[b] = mirror(unity[b]);
      const Matrix own = matrix_of(unity[b]);
      world[b] = b == 0 ? own : times(world[size_t(humanoid_parent(b))], own);
    }
    const BodyPose body(pose);
    const auto check = [&](const char* name, const std::string& from, const std::string& to,
                           const glm::dvec3& in_t_pose) {
      const glm::dvec3 wanted = mirror(times(world[bone(name)], mirror(in_t_pose)));
      worst = std::max(worst, glm::distance(body.direction(from, to), wanted));
    };
    for (const double side : {1.0, -1.0}) {
      const std::string s = side > 0 ? "left_" : "right_", B = side > 0 ? "Left" : "Right";
      check((B + "UpperArm").c_str(), s + "shoulder", s + "elbow", {side, 0, 0});
      check((B + "LowerArm").c_str(), s + "elbow", s + "wrist", {side, 0, 0});
      check((B + "Hand").c_str(), s + "wrist", s + "middle1", {side, 0, 0});
      check((B + "RingIntermediate").c_str(), s + "ring2", s + "ring3", {side, 0, 0});
      check((B + "ThumbProximal").c_str(), s + "thumb1", s + "thumb2",
            glm::normalize(glm::dvec3(side, 0, 1)));
      check((B + "UpperLeg").c_str(), s + "hip", s + "knee", {0, -1, 0});
      check((B + "LowerLeg").c_str(), s + "knee", s + "ankle", {0, -1, 0});
    }
    for (const auto& [name, from, to] : {std::array<const char*, 3>{"Hips", "pelvis", "spine1"},
                                         {"Spine", "spine1", "spine2"},
                                         {"UpperChest", "spine3", "neck"},
                                         {"Head", "head", "right_eye"}})
      check(name, from, to, rest_direction(from, to));
  }
  std::printf("largest distance of directions: %g\n", worst);
  EXPECT_LT(worst, kTolerance);
}

TEST(Humanoid, ThereAndBackIsTheSamePose) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 50; ++round) {
    std::vector<float> rotations;
    for (size_t j = 0; j < figure().count(); ++j) {
      const glm::dquat q = glm::normalize(
          glm::dquat(normal(random), normal(random), normal(random), normal(random)));
      for (const double v : {q.w, q.x, q.y, q.z}) rotations.push_back(static_cast<float>(v));
    }
    const PoseView there{{0.3f, -0.1f, 1.5f}, rotations};
    const BodyPose back(rig().from_body(there));
    for (size_t j = 0; j < figure().count(); ++j) {
      EXPECT_LT(tests::angle_deg(&rotations[4 * j], &back.rotations[4 * j]), 1e-4)
          << figure().names()[j];
    }
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(back.root_m[k], there.root_translation_m[k], 1e-6);
  }
}

TEST(Humanoid, TheRootFollowsTheHipsByTheLengthOfLegs) {
  const std::vector<float> rest_rotations = [] {
    std::vector<float> q;
    for (size_t j = 0; j < figure().count(); ++j) q.insert(q.end(), {1, 0, 0, 0});
    return q;
  }();
  HumanoidPose pose = rig().from_body({{0, 0, 0}, rest_rotations});
  for (glm::dvec3& offset : pose.offset_m) offset *= 0.5;  // a model of half the size
  EXPECT_NEAR(BodyPose(pose).root_m[1], 0, 1e-6);
  pose.root_m = {0.5, 0, 0.25};
  EXPECT_NEAR(BodyPose(pose).root_m[0], 1.0, 1e-6);
  EXPECT_NEAR(BodyPose(pose).root_m[2], 0.5, 1e-6);
  pose.root = glm::angleAxis(3.14159265358979323846 / 2, glm::dvec3(0, 1, 0));
  // At rest it is (0.03, -0.06, 0.12); the whole model has turned to its left.
  expect_direction(BodyPose(pose).direction("left_ankle", "left_foot"), {0.12, -0.06, -0.03},
                   "foot");

  // What no model can have leaves the root in its place.
  HumanoidPose odd = pose;
  odd.has_offset[bone("LeftFoot")] = false;
  EXPECT_EQ(BodyPose(odd).root_m, (std::array<float, 3>{0, 0, 0}));
  odd = pose;
  for (glm::dvec3& offset : odd.offset_m) offset *= 1e-6;
  EXPECT_EQ(BodyPose(odd).root_m, (std::array<float, 3>{0, 0, 0}));
  odd = pose;
  odd.root_m = {1e4, 0, 0};
  EXPECT_EQ(BodyPose(odd).root_m, (std::array<float, 3>{0, 0, 0}));
}

TEST(Humanoid, ABodyMayLackFingersButNotArms) {
  const auto without = [](const std::string& part) {
    std::vector<std::string> names = figure().names();
    for (std::string& name : names) {
      if (name.find(part) != std::string::npos) name = "other " + name;
    }
    return HumanoidRig::create(names, figure().rest());
  };
  EXPECT_TRUE(without("ring").ok());
  EXPECT_TRUE(without("eye").ok());
  EXPECT_TRUE(without("spine3").ok());
  const Result<HumanoidRig> armless = without("left_elbow");
  ASSERT_FALSE(armless.ok());
  EXPECT_EQ(armless.status().message(),
            "body: has no joint 'left_elbow' for the humanoid bone LeftLowerArm");
  // A bone without a joint turns what hangs on it all the same.
  HumanoidPose pose;
  turn_in_unity(pose, "UpperChest", 0, 1, 0, 90);
  std::vector<float> rotations(4 * figure().count());
  std::array<float, 3> root{};
  without("spine3").value().to_body(pose, rotations, root);
  std::vector<Affine> world(figure().count());
  skinning_transforms(figure().rest(), {root, rotations}, world);
  const size_t head = figure().joint("head");
  EXPECT_NEAR(world[head].m[2], -1, 1e-6) << "z of the head turned to -x";
}

}  // namespace
}  // namespace figurine::ports::humanoid_test
