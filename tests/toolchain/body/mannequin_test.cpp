// The mannequin as a surface: closed, outward, symmetric, every part with texels, its shape space
// close to linear.
#include "toolchain/body/mannequin.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gtest/gtest.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body::mannequin_test {
namespace {

const BodyModel& model() {
  static const BodyModel body = make_mannequin();
  return body;
}

TEST(Mannequin, IsClosedAndFacesOutward) {
  const Surface& s = model().surface;
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  double volume = 0;
  for (size_t t = 0; t < s.triangles.size(); t += 3) {
    const float* p[3];
    for (size_t c = 0; c < 3; ++c) {
      p[c] = &s.position_m[3 * size_t{s.triangles[t + c]}];
      ++edges[{s.triangles[t + c], s.triangles[t + (c + 1) % 3]}];
    }
    volume += (p[0][0] * (double{p[1][1]} * p[2][2] - double{p[1][2]} * p[2][1]) +
               p[0][1] * (double{p[1][2]} * p[2][0] - double{p[1][0]} * p[2][2]) +
               p[0][2] * (double{p[1][0]} * p[2][1] - double{p[1][1]} * p[2][0])) /
              6;
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
  std::printf("volume %.1f litres\n", 1e3 * volume);
  EXPECT_GT(volume, 0.045);
  EXPECT_LT(volume, 0.090);
}

TEST(Mannequin, IsAPersonOf170Centimetres) {
  float low = 9, high = -9;
  for (size_t i = 1; i < model().surface.position_m.size(); i += 3) {
    ASSERT_TRUE(std::isfinite(model().surface.position_m[i]));
    low = std::min(low, model().surface.position_m[i]);
    high = std::max(high, model().surface.position_m[i]);
  }
  EXPECT_NEAR(low, 0, 0.005);
  EXPECT_NEAR(high, 1.70, 0.005);
}

TEST(Mannequin, LeftAndRightMirror) {
  const JointPositions& j = model().joint_m;
  for (uint32_t left = 0; left < kJointCount; ++left) {
    const std::string& name = joint_names()[left];
    if (name.rfind("left_", 0) != 0) continue;
    const auto found =
        std::find(joint_names().begin(), joint_names().end(), "right_" + name.substr(5));
    ASSERT_NE(found, joint_names().end());
    const size_t right = static_cast<size_t>(found - joint_names().begin());
    EXPECT_NEAR(j[3 * left], -j[3 * right], 1e-6) << name;
    EXPECT_NEAR(j[3 * left + 1], j[3 * right + 1], 1e-6) << name;
    EXPECT_NEAR(j[3 * left + 2], j[3 * right + 2], 1e-6) << name;
    EXPECT_GT(j[3 * left], 0) << name;
  }
}

TEST(Mannequin, EveryJointButCollarsJawAndEyesMovesSomething) {
  std::set<int> used;
  for (size_t i = 0; i < model().surface.skin_weights.size(); ++i) {
    if (model().surface.skin_weights[i] > 0.4f) used.insert(model().surface.skin_joints[i]);
  }
  for (int j = 0; j < static_cast<int>(kJointCount); ++j) {
    if (j == kJaw || j == kLeftEye || j == kRightEye) continue;
    EXPECT_TRUE(used.count(j)) << joint_names()[static_cast<size_t>(j)];
  }
}

TEST(Mannequin, EveryPartHasTexelsAt32AndNoneOverlap) {
  const TexelBody body = make_texel_body(model(), 32);
  std::map<int, int> texels;  // by heaviest joint
  for (size_t row = 0; row < body.texel.size(); ++row) ++texels[body.joints[row * kSkinInfluences]];
  for (int j : {int(kHead), int(kLeftThumb1), int(kRightPinky1 + 1), int(kLeftWrist),
                int(kRightFoot), int(kSpine2), int(kLeftElbow)}) {
    EXPECT_GE(texels[j], 2) << joint_names()[static_cast<size_t>(j)];
  }
  // Without overlap, areas of the charts add up to the covered area.
  const Surface& s = model().surface;
  double area = 0;
  for (size_t t = 0; t < s.uv_triangles.size(); t += 3) {
    const float* a = &s.uv[2 * size_t{s.uv_triangles[t]}];
    const float* b = &s.uv[2 * size_t{s.uv_triangles[t + 1]}];
    const float* c = &s.uv[2 * size_t{s.uv_triangles[t + 2]}];
    area += 0.5 * std::abs((double{b[0]} - a[0]) * (double{c[1]} - a[1]) -
                           (double{b[1]} - a[1]) * (double{c[0]} - a[0]));
  }
  EXPECT_NEAR(static_cast<double>(make_texel_body(model(), 512).texel.size()) / (512 * 512), area,
              2e-3);
}

TEST(Mannequin, ShapeSpaceIsCloseToTheBuilder) {
  const MannequinShape shapes[] = {{.stature = 1},
                                   {.girth = -1},
                                   {.legs = 1},
                                   {.shoulders = -1},
                                   {.stature = 1, .girth = -1, .legs = 1, .shoulders = 1}};
  double worst = 0;
  for (const MannequinShape& shape : shapes) {
    const std::vector<float> coefficients = {shape.stature, shape.girth, shape.legs,
                                             shape.shoulders};
    const std::vector<float> linear = shaped_vertices(model(), coefficients),
                             own = mannequin_vertices(shape);
    const JointPositions joints = shaped_joints(model(), coefficients),
                         own_joints = mannequin_joints(shape);
    for (size_t i = 0; i < own.size(); ++i)
      worst = std::max(worst, std::abs(double{own[i]} - linear[i]));
    for (size_t i = 0; i < own_joints.size(); ++i)
      worst = std::max(worst, std::abs(double{own_joints[i]} - joints[i]));
    const std::vector<float> back = project_shape(model(), linear);
    for (size_t s = 0; s < 4; ++s) EXPECT_NEAR(back[s], coefficients[s], 1e-3);
  }
  std::printf("largest distance of the linear shape space from the builder %.2f mm\n", 1e3 * worst);
  EXPECT_LT(worst, 0.002);
}

TEST(Mannequin, IsTheSameEveryTime) {
  const BodyModel again = make_mannequin();
  EXPECT_EQ(again.surface.position_m, model().surface.position_m);
  EXPECT_EQ(again.vertex_shape_basis_m, model().vertex_shape_basis_m);
}

}  // namespace
}  // namespace figurine::body::mannequin_test
