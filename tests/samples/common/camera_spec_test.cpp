// --camera: orbits and JSON files, and everything that is refused with the field's name.
#include "samples/common/camera_spec.h"

#include <gtest/gtest.h>

namespace figurine::samples::camera_spec_test {
namespace {

constexpr const char* kSound =
    R"({"width": 640, "height": 480, "intrinsics": [[500, 0, 320], [0, 510, 240], [0, 0, 1]],
  "world_to_camera": [[1, 0, 0, 0.5], [0, -1, 0, 1], [0, 0, -1, 3]], "near": 0.05})";

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
       {"orbit:", "orbit:1,2", "orbit:1,2,3,4,5", "orbit:a,2,3", "orbit:0,90,2", "orbit:0,0,0",
        "orbit:0,0,-1", "orbit:0,0,1,0.5", "orbit:0,0,1,171", "orbit:nan,0,1", "orbit:0,0,inf"}) {
    EXPECT_FALSE(parse_camera_spec(text).ok()) << text;
  }
}

TEST(CameraSpec, AMissingFileIsNamed) {
  const Result<CameraSpec> spec = parse_camera_spec("no/such/camera.json");
  ASSERT_FALSE(spec.ok());
  EXPECT_NE(spec.status().message().find("no/such/camera.json"), std::string::npos);
}

TEST(CameraJson, ReadsIntrinsicsAndPose) {
  const Result<Camera> camera = parse_camera_json(kSound, "c.json");
  ASSERT_TRUE(camera.ok()) << camera.status().message();
  EXPECT_EQ(camera->width_px, 640u);
  EXPECT_EQ(camera->height_px, 480u);
  EXPECT_EQ(camera->fx_px, 500.0f);
  EXPECT_EQ(camera->fy_px, 510.0f);
  EXPECT_EQ(camera->cx_px, 320.0f);
  EXPECT_EQ(camera->cy_px, 240.0f);
  EXPECT_EQ(camera->near_m, 0.05f);
  EXPECT_EQ(camera->view_from_world[3], 0.5f);
  EXPECT_EQ(camera->view_from_world[5], -1.0f);
  EXPECT_EQ(camera->view_from_world[11], 3.0f);
}

TEST(CameraJson, NamesTheFieldThatIsWrong) {
  const auto expect = [](const char* from, const char* to, const char* field) {
    std::string text = kSound;
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, std::string(from).size(), to);
    const Result<Camera> camera = parse_camera_json(text, "c.json");
    ASSERT_FALSE(camera.ok()) << text;
    EXPECT_NE(camera.status().message().find("c.json"), std::string::npos)
        << camera.status().message();
    EXPECT_NE(camera.status().message().find(field), std::string::npos)
        << camera.status().message();
  };
  expect("640", "0", "width");
  expect("640", "1e9", "width");
  expect("640", "\"a\"", "width");
  expect("\"height\": 480, ", "", "width and height");
  expect("500", "-500", "focal");
  expect("500", "\"500\"", "intrinsics");
  expect("[500, 0, 320]", "[500, 0.1, 320]", "skew");
  expect("intrinsics", "intrinsic", "intrinsics");
  expect("[[1, 0, 0, 0.5]", "[[2, 0, 0, 0.5]", "rotation");
  expect("[[1, 0, 0, 0.5], ", "[", "world_to_camera");
  expect("0.05", "0", "near");
  expect("0.05", "[]", "near");
  expect("{", "[", "JSON object");
}

TEST(ResizeCamera, KeepsThePicture) {
  const Result<Camera> camera = parse_camera_json(kSound, "c.json");
  const Result<Camera> half = resize_camera(*camera, {320, 240});
  ASSERT_TRUE(half.ok());
  EXPECT_EQ(half->fx_px, 250.0f);
  EXPECT_EQ(half->fy_px, 255.0f);
  EXPECT_EQ(half->cx_px, 160.0f);
  EXPECT_EQ(half->cy_px, 120.0f);
  EXPECT_FALSE(resize_camera(*camera, {320, 320}).ok());
}

}  // namespace
}  // namespace figurine::samples::camera_spec_test
