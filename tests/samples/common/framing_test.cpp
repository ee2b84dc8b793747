// The default camera: what it must hold is inside the picture, and it does not stand further away
// than that needs.
#include "samples/common/framing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace figurine::samples::framing_test {
namespace {

std::vector<Point> box_corners(Point low, Point high) {
  std::vector<Point> points;
  for (int corner = 0; corner < 8; ++corner) {
    points.push_back({corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1],
                      corner & 4 ? high[2] : low[2]});
  }
  return points;
}

// The largest |offset from the middle| / half size over all points, as the real camera sees them.
double reach(const std::vector<Point>& points, const OrbitCamera& orbit, uint32_t width,
             uint32_t height) {
  const Result<Camera> camera = make_orbit_camera(orbit, width, height);
  EXPECT_TRUE(camera.ok());
  double largest = 0;
  for (const Point& p : points) {
    double view[3];
    const auto& m = camera->view_from_world;
    for (int r = 0; r < 3; ++r)
      view[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    EXPECT_GT(view[2], 0);
    largest = std::max({largest, std::abs(camera->fx_px * view[0] / view[2]) / (0.5 * width),
                        std::abs(camera->fy_px * view[1] / view[2]) / (0.5 * height)});
  }
  return largest;
}

TEST(FitDistance, TouchesTheMarginFromAnyDirectionAndShape) {
  const std::vector<Point> points = box_corners({-0.5f, 0, -0.3f}, {0.5f, 1.8f, 0.3f});
  for (const float azimuth : {0.0f, 40.0f, 200.0f}) {
    for (const float elevation : {-30.0f, 0.0f, 60.0f}) {
      for (const auto& [width, height] : {std::pair{512u, 512u}, {300u, 700u}, {900u, 200u}}) {
        OrbitCamera orbit{
            .azimuth_deg = azimuth, .elevation_deg = elevation, .target_m = {0, 0.9f, 0}};
        orbit.distance_m =
            fit_distance_m(points, orbit, double(width) / height, {.share = 1, .margin = 0.1});
        EXPECT_NEAR(reach(points, orbit, width, height), 0.9, 1e-4)
            << azimuth << " " << elevation << " " << width;
      }
    }
  }
}

TEST(FitDistance, IgnoresStraysAndNotFinitePoints) {
  std::vector<Point> points;
  for (int i = 0; i < 1000; ++i)
    points.push_back(
        {0.001f * static_cast<float>(i % 100), 0.001f * static_cast<float>(i / 10), 0});
  OrbitCamera orbit;
  const float near_distance = fit_distance_m(points, orbit, 1);
  points.push_back({1e6f, 0, 0});
  points.push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  points.push_back({0, std::numeric_limits<float>::infinity(), 0});
  EXPECT_NEAR(fit_distance_m(points, orbit, 1), near_distance, 0.01 * near_distance);
}

TEST(FitDistance, WithoutPointsStaysAsItIs) {
  EXPECT_EQ(fit_distance_m({}, {.distance_m = 7}, 1), 7.0f);
}

TEST(RobustCentre, IsTheMiddleOfTheMassNotOfTheExtremes) {
  std::vector<Point> points;
  for (int i = 0; i <= 100; ++i)
    points.push_back({static_cast<float>(i), 2 * static_cast<float>(i), -1});
  points.push_back({1e9f, -1e9f, 0});
  const Point centre = robust_centre(points, 0.9);
  EXPECT_NEAR(centre[0], 50, 1.5);
  EXPECT_NEAR(centre[1], 100, 3);
  EXPECT_NEAR(centre[2], -1, 1e-6);
}

Body small_body(std::vector<std::string> joints) {
  Body body;
  body.name = "small";
  body.joint_names = std::move(joints);
  return body;
}

TEST(FramedJoints, AreFoundByName) {
  const Body body = small_body({"pelvis", "neck", "left_collar", "head", "jaw"});
  EXPECT_EQ(*framed_joints(body, Framing::kHead), (std::vector<uint8_t>{3, 4}));
  EXPECT_EQ(*framed_joints(body, Framing::kBust), (std::vector<uint8_t>{3, 4, 2, 1}))
      << "the head is the first";
  const Result<std::vector<uint8_t>> none = framed_joints(small_body({"pelvis"}), Framing::kBust);
  EXPECT_EQ(none.status().code(), StatusCode::kUnsupported);
  EXPECT_EQ(none.status().message(), "framing: body 'small' has no joint called head");
}

TEST(FramedJoints, HoldTheTexelsThatTheyMoveMost) {
  std::vector<uint8_t> joints(2 * kSkinInfluences, 0);
  std::vector<float> weights(2 * kSkinInfluences, 0);
  joints[1] = 2, weights[0] = 0.6f, weights[1] = 0.4f;
  joints[kSkinInfluences + 1] = 2, joints[kSkinInfluences + 2] = 1;
  weights[kSkinInfluences] = 0.1f, weights[kSkinInfluences + 1] = 0.7f;
  weights[kSkinInfluences + 2] = 0.2f;
  Body body = small_body({"pelvis", "neck", "head"});
  body.texel_joints = joints;
  body.texel_weights = weights;
  const std::vector<uint8_t> head{2};
  EXPECT_FALSE(moved_most_by(body, 0, head));
  EXPECT_TRUE(moved_most_by(body, 1, head));
}

TEST(Framing, IsOneOfThree) {
  EXPECT_EQ(*parse_framing("bust"), Framing::kBust);
  EXPECT_EQ(parse_framing("feet").status().code(), StatusCode::kInvalidArgument);
}

TEST(SmoothPath, KeepsAStraightWalkAndFlattensBobbing) {
  std::vector<Point> straight, bobbing;
  for (int i = 0; i < 100; ++i) {
    const float x = 0.04f * static_cast<float>(i);
    straight.push_back({x, 1 - x, 0.5f * x});
    bobbing.push_back({x, 1 - x + 0.03f * std::sin(0.9f * static_cast<float>(i)), 0.5f * x});
  }
  const auto smooth_straight = smooth_path(straight, 12), smooth_bobbing = smooth_path(bobbing, 12);
  for (size_t i = 0; i < straight.size(); ++i) {
    EXPECT_NEAR(smooth_straight[i][0], straight[i][0], 1e-5) << i;  // at the ends, too
    EXPECT_NEAR(smooth_straight[i][1], straight[i][1], 1e-5) << i;
    EXPECT_NEAR(smooth_straight[i][2], straight[i][2], 1e-5) << i;
    EXPECT_NEAR(smooth_bobbing[i][1], straight[i][1], 0.01) << i;
  }
}

TEST(SmoothPath, OneFrameStaysWhereItIs) {
  const Point place{3, 4, 5};
  EXPECT_EQ(smooth_path({&place, 1}, 12)[0], place);
}

}  // namespace
}  // namespace figurine::samples::framing_test
