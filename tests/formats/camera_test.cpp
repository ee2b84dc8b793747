// The orbit camera and the checks of a camera (formats/src/camera.cpp).
#include "figurine/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/largest_error.h"

namespace figurine::camera_test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Seen {
  double x_px, y_px, depth_m;
};

Seen project(const Camera& camera, const std::array<double, 3>& world) {
  double view[3];
  for (int i = 0; i < 3; ++i) {
    const float* row = &camera.view_from_world[4 * i];
    view[i] = row[0] * world[0] + row[1] * world[1] + row[2] * world[2] + row[3];
  }
  return {camera.fx_px * view[0] / view[2] + camera.cx_px,
          camera.fy_px * view[1] / view[2] + camera.cy_px, view[2]};
}

Camera orbit(const OrbitCamera& options) {
  const Result<Camera> camera = make_orbit_camera(options, 640, 480);
  EXPECT_TRUE(camera.ok()) << camera.status().message();
  return *camera;
}

TEST(OrbitCamera, IsOrthonormalRightHandedAndSeesItsTargetAtTheCentre) {
  LargestError orthonormality("R R^T - I"), centre("target at the image centre [px]"),
      depth("distance, relative");
  for (float azimuth : {-540.0f, -180.0f, -90.0f, -1.0f, 0.0f, 30.0f, 90.0f, 179.0f, 1000.0f}) {
    for (float elevation : {-90.0f, -89.0f, -45.0f, 0.0f, 10.0f, 90.0f}) {
      for (float distance : {0.1f, 3.0f, 100.0f}) {
        const Camera camera = orbit({.azimuth_deg = azimuth,
                                     .elevation_deg = elevation,
                                     .distance_m = distance,
                                     .target_m = {0.5f, 1.0f, -2.0f}});
        const std::array<float, 12>& m = camera.view_from_world;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            double dot = 0;
            for (int k = 0; k < 3; ++k) dot += double(m[4 * i + k]) * m[4 * j + k];
            orthonormality.add(dot, i == j ? 1 : 0);
          }
        }
        const double determinant = m[0] * (double(m[5]) * m[10] - double(m[6]) * m[9]) -
                                   m[1] * (double(m[4]) * m[10] - double(m[6]) * m[8]) +
                                   m[2] * (double(m[4]) * m[9] - double(m[5]) * m[8]);
        orthonormality.add(determinant, 1);
        const Seen seen = project(camera, {0.5, 1.0, -2.0});
        depth.add(seen.depth_m / distance, 1);
        // The translation is rounded to float: at 10 cm one of 2.3 m loses 1e-7 m, which is 1e-6 of
        // the distance.
        centre.add((seen.x_px - 320) * distance / camera.fx_px, 0);
        centre.add((seen.y_px - 240) * distance / camera.fy_px, 0);
      }
    }
  }
  EXPECT_LE(orthonormality.largest(), 3e-7);
  EXPECT_LE(depth.largest(), 5e-6);
  EXPECT_LE(centre.largest(), 1e-5);
}

TEST(OrbitCamera, UpInTheWorldIsUpInTheImageAndPlusXIsTheFiguresLeft) {
  const Camera front = orbit({});
  EXPECT_LT(project(front, {0, 0.5, 0}).y_px, 240);  // y down in the image
  EXPECT_GT(project(front, {0.5, 0, 0}).x_px,
            320);  // a figure that faces the camera has its left hand on the right of the image
  const Camera left = orbit({.azimuth_deg = 90});
  EXPECT_LT(project(left, {0.5, 0, 0}).depth_m, 3);  // the camera went to +x
  const Camera above = orbit({.elevation_deg = 60});
  EXPECT_LT(project(above, {0, 0.5, 0}).depth_m, 3);
}

TEST(OrbitCamera, FieldOfViewSpansTheImageHeight) {
  for (float fov : {1.0f, 40.0f, 90.0f, 170.0f}) {
    const Camera camera = orbit({.vertical_fov_deg = fov});
    const double half = 3 * std::tan(fov * 3.14159265358979 / 360);
    EXPECT_NEAR(project(camera, {0, half, 0}).y_px, 0, 1e-3) << fov;
    EXPECT_EQ(camera.fx_px, camera.fy_px);
  }
}

// Quarter turns have no crumbs of pi in them, and whole turns change nothing.
TEST(OrbitCamera, WholeTurnsAndQuarterTurnsAreExact) {
  const std::array<float, 12> quarter{0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, 3};
  EXPECT_EQ(orbit({.azimuth_deg = 90}).view_from_world, quarter);
  for (const float turn : {-36000.0f, -360.0f, 360.0f, 720.0f}) {
    EXPECT_EQ(orbit({.azimuth_deg = turn + 90}).view_from_world, quarter) << turn;
    EXPECT_EQ(orbit({.azimuth_deg = turn}).view_from_world, orbit({}).view_from_world) << turn;
  }
}

TEST(OrbitCamera, RejectsValuesOutsideItsRanges) {
  for (const OrbitCamera& bad :
       {OrbitCamera{.azimuth_deg = kNan}, OrbitCamera{.azimuth_deg = kInfinity},
        OrbitCamera{.elevation_deg = 91}, OrbitCamera{.elevation_deg = kNan},
        OrbitCamera{.distance_m = 0}, OrbitCamera{.distance_m = -1},
        OrbitCamera{.distance_m = kInfinity}, OrbitCamera{.vertical_fov_deg = 0.5f},
        OrbitCamera{.vertical_fov_deg = 171}, OrbitCamera{.vertical_fov_deg = kNan},
        OrbitCamera{.target_m = {kNan, 0, 0}}}) {
    EXPECT_EQ(make_orbit_camera(bad, 64, 64).status().code(), StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(make_orbit_camera({}, 0, 64).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(make_orbit_camera({}, 64, 16385).status().code(), StatusCode::kInvalidArgument);
}

TEST(ValidateCamera, RejectsEveryUnsoundField) {
  const Camera sound = orbit({});
  EXPECT_TRUE(validate_camera(sound).ok());
  const auto rejected = [&](auto change, const char* word) {
    Camera camera = sound;
    change(camera);
    const Status status = validate_camera(camera);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << word;
    EXPECT_NE(status.message().find(word), std::string::npos) << status.message();
  };
  rejected([](Camera& c) { c.width_px = 0; }, "image size");
  rejected([](Camera& c) { c.height_px = 20000; }, "image size");
  rejected([](Camera& c) { c.fx_px = 0; }, "focal");
  rejected([](Camera& c) { c.fy_px = -1; }, "focal");
  rejected([](Camera& c) { c.fx_px = kNan; }, "focal");
  rejected([](Camera& c) { c.cx_px = kInfinity; }, "principal point");
  rejected([](Camera& c) { c.view_from_world[3] = kNan; }, "finite");
  rejected([](Camera& c) { c.view_from_world[0] *= 1.01f; }, "rotation");
  rejected([](Camera& c) { c.near_m = 0; }, "near");
  rejected([](Camera& c) { c.near_m = kNan; }, "near");
  rejected(
      [](Camera& c) {  // a mirror is no rotation
        for (int k = 0; k < 3; ++k) c.view_from_world[k] = -c.view_from_world[k];
      },
      "rotation");
}

}  // namespace
}  // namespace figurine::camera_test
