// --camera: orbits and files, and everything that is refused with a word.
#include "samples/common/camera_spec.h"

#include <gtest/gtest.h>

namespace figurine::samples::camera_spec_test {
namespace {

TEST(CameraSpec, ReadsAnOrbit) {
  const Result<CameraSpec> spec = parse_camera_spec("orbit:30,-10,2.5");
  ASSERT_TRUE(spec.ok()) << spec.status().message();
  ASSERT_TRUE(spec->orbit.has_value());
  EXPECT_FALSE(spec->fixed.has_value());
  EXPECT_EQ(spec->orbit->azimuth_deg, 30.0f);
  EXPECT_EQ(spec->orbit->elevation_deg, -10.0f);
  EXPECT_EQ(spec->orbit->distance_m, 2.5f);
  EXPECT_EQ(spec->orbit->vertical_fov_deg, OrbitCamera{}.vertical_fov_deg);
  EXPECT_EQ(parse_camera_spec("orbit:0,0,1,60")->orbit->vertical_fov_deg, 60.0f);
}

TEST(CameraSpec, RefusesUnsoundOrbits) {
  for (const char* text :
       {"orbit:", "orbit:1,2", "orbit:1,2,3,4,5", "orbit:a,2,3", "orbit:0,91,2", "orbit:0,0,0",
        "orbit:0,0,-1", "orbit:0,0,1,0.5", "orbit:0,0,1,171", "orbit:nan,0,1", "orbit:0,0,inf"}) {
    EXPECT_FALSE(parse_camera_spec(text).ok()) << text;
  }
}

TEST(CameraSpec, AMissingFileIsNamed) {
  const Result<CameraSpec> spec = parse_camera_spec("no/such/camera.json");
  ASSERT_FALSE(spec.ok());
  EXPECT_NE(spec.status().message().find("no/such/camera.json"), std::string::npos);
}

TEST(CameraSpec, OrbitsFromStraightAboveAndBelow) {
  for (const char* text : {"orbit:20,90,2", "orbit:20,-90,2"}) {
    const Result<CameraSpec> spec = parse_camera_spec(text);
    ASSERT_TRUE(spec.ok()) << spec.status().message();
    EXPECT_TRUE(make_orbit_camera(*spec->orbit, 64, 48).ok());
  }
}

TEST(CameraSpec, NamesTheFileBehindAHash) {
  for (const char* text : {"no/such.json#3", "no/such.json"}) {
    const Result<CameraSpec> spec = parse_camera_spec(text);
    ASSERT_FALSE(spec.ok());
    EXPECT_NE(spec.status().message().find("no/such.json:"), std::string::npos)
        << spec.status().message();
  }
  EXPECT_FALSE(parse_camera_spec("no/such.json#").ok());
}

}  // namespace
}  // namespace figurine::samples::camera_spec_test
