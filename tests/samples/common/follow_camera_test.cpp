// A camera that goes along: what it sees of a figure that walked is in the end what it saw at
// first.
#include "samples/common/follow_camera.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::samples::follow_camera_test {
namespace {

using Point = std::array<float, 3>;

Camera orbit() {
  return make_orbit_camera({.azimuth_deg = 30, .elevation_deg = 10, .target_m = {0, 1, 0}}, 64, 64)
      .value();
}

Point seen(const Camera& camera, const Point& p) {
  Point view{};
  for (size_t r = 0; r < 3; ++r) {
    const float* row = &camera.view_from_world[4 * r];
    view[r] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
  }
  return view;
}

TEST(FollowCamera, EndsWhereItSeesWhatItSawAtFirst) {
  const Camera start = orbit();
  FollowCamera camera(start, {0, 0.9f, 0}, true);
  EXPECT_EQ(camera.step({0, 1.2f, 0}, 0.1).view_from_world, start.view_from_world)
      << "heights do not count";
  for (int i = 1; i <= 50; ++i) camera.step({0.02f * float(i), 0.9f, -0.01f * float(i)}, 1.0 / 30);
  for (int i = 0; i < 200; ++i) camera.step({1, 0.9f, -0.5f}, 1.0 / 30);
  const Point before = seen(start, {0, 0.9f, 0}),
              after = seen(camera.step({1, 0.9f, -0.5f}, 1.0 / 30), {1, 0.9f, -0.5f});
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(after[k], before[k], 1e-5);
  EXPECT_TRUE(validate_camera(camera.step({1, 0, 0}, 0.1)).ok());
}

TEST(FollowCamera, LagsByItsTimeConstantWhateverTheRate) {
  for (const int rate : {10, 60, 200}) {
    FollowCamera camera(orbit(), {0, 0, 0}, true);
    for (int i = 0; i < rate * 4 / 10; ++i) camera.step({0.9f, 0, 0}, 1.0 / rate);
    const Point first = seen(orbit(), {0, 0, 0}),
                now = seen(camera.step({0.9f, 0, 0}, 0), {0.9f * float(1 - std::exp(-1.0)), 0, 0});
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(now[k], first[k], 1e-5) << rate;
  }
}

TEST(FollowCamera, JumpsWithALoopThatBeginsAgain) {
  FollowCamera camera(orbit(), {0, 0, 0}, true);
  const Point first = seen(orbit(), {0, 0, 0}), now = seen(camera.step({3, 0, 0}, 1e-3), {3, 0, 0});
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(now[k], first[k], 1e-5);
}

TEST(FollowCamera, StaysWhenItIsToldTo) {
  FollowCamera camera(orbit(), {0, 0, 0}, false);
  EXPECT_EQ(camera.step({3, 0, 0}, 1).view_from_world, orbit().view_from_world);
}

}  // namespace
}  // namespace figurine::samples::follow_camera_test
