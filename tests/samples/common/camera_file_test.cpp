// Cameras in JSON files of three kinds: the same view from each, and every bad field by its name.
#include "samples/common/camera_file.h"

#include <gtest/gtest.h>

#include <cmath>

namespace figurine::samples::camera_file_test {
namespace {

constexpr const char* kOwn =
    R"({"width": 640, "height": 480, "intrinsics": [[500, 0, 320], [0, 510, 240], [0, 0, 1]],
  "world_to_camera": [[1, 0, 0, 0.5], [0, -1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]], "near": 0.05})";

// Turned by a quarter about y, at (1, 2, 3).
constexpr const char* k3dgs =
    R"([{"id": 0, "img_name": "first", "width": 640, "height": 480, "position": [0, 0, 0],
         "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fx": 1, "fy": 1},
        {"id": 1, "img_name": "dir/00042.png", "width": 640, "height": 480, "position": [1, 2, 3],
         "rotation": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], "fx": 500, "fy": 510}])";

// The same one: y and z of the camera turned round.
constexpr const char* kNerf =
    R"({"fl_x": 500, "fl_y": 510, "w": 640, "h": 480, "cx": 320, "cy": 240, "frames": [
        {"file_path": "images/00042.png", "transform_matrix":
          [[0, 0, -1, 1], [0, -1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]]}]})";

Result<FileCamera> parse(const std::string& json, const std::string& which = "") {
  return parse_camera_file(json, "c.json", which);
}

FileCamera sound(const std::string& json, const std::string& which = "") {
  const Result<FileCamera> camera = parse(json, which);
  EXPECT_TRUE(camera.ok()) << camera.status().message();
  return camera.ok() ? *camera : FileCamera{};
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(CameraFile, ReadsOurOwn) {
  const FileCamera file = sound(kOwn);
  const Result<Camera> camera = fixed_camera(file, std::nullopt, {1, 1});
  ASSERT_TRUE(camera.ok());
  EXPECT_EQ(camera->width_px, 640u);
  EXPECT_EQ(camera->height_px, 480u);
  EXPECT_EQ(camera->fx_px, 500.0f);
  EXPECT_EQ(camera->fy_px, 510.0f);
  EXPECT_EQ(camera->cx_px, 320.0f);
  EXPECT_EQ(camera->cy_px, 240.0f);
  EXPECT_EQ(camera->near_m, 0.05f);
  EXPECT_EQ(camera->view_from_world,
            (std::array<float, 12>{1, 0, 0, 0.5f, 0, -1, 0, 1, 0, 0, -1, 3}));
  EXPECT_TRUE(file.said.empty());
  EXPECT_TRUE(parse(replaced(kOwn, ", [0, 0, 0, 1]]", "]")).ok()) << "3x4";
}

TEST(CameraFile, TheSameViewFromCamerasAndFromTransforms) {
  const FileCamera ours = sound(k3dgs, "1"), nerf = sound(kNerf);
  // What lies ahead of it by 2, at (3, 2, 3), is in the middle: the third column is where it looks.
  EXPECT_EQ(ours.view_from_world, (std::array<double, 12>{0, 0, -1, 3, 0, 1, 0, -2, 1, 0, 0, -1}));
  for (size_t k = 0; k < 12; ++k) EXPECT_EQ(ours.view_from_world[k], nerf.view_from_world[k]) << k;
  EXPECT_EQ(ours.fx_px, 500);
  EXPECT_EQ(ours.fy_px, 510);
  EXPECT_EQ(ours.cx_px, 320);
  EXPECT_EQ(ours.cy_px, 240);
  EXPECT_EQ(ours.said, "camera 1 of 2 (00042.png)");
  EXPECT_EQ(nerf.said, "camera 0 of 1 (00042.png)");
  EXPECT_EQ(nerf.fy_px, 510);
}

TEST(CameraFile, IsChosenByNumberOrByName) {
  EXPECT_EQ(sound(k3dgs).fx_px, 1) << "the first";
  for (const char* which : {"1", "00042.png", "00042"}) EXPECT_EQ(sound(k3dgs, which).fx_px, 500);
  for (const auto& [which, reason] : {std::pair("2", "there are 2, counted from 0"),
                                      {"-1", "no camera is called '-1'"},
                                      {"1.5", "no camera is called"},
                                      {"99999999999999999999", "no camera is called"}}) {
    const Result<FileCamera> camera = parse(k3dgs, which);
    ASSERT_FALSE(camera.ok()) << which;
    EXPECT_NE(camera.status().message().find(reason), std::string::npos)
        << camera.status().message();
  }
  EXPECT_FALSE(parse(kOwn, "0").ok());
}

TEST(CameraFile, IntrinsicsOfNerfsInAllTheirForms) {
  const std::string pose = R"("frames": [{"transform_matrix":
      [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})";
  const double angle = 2 * std::atan(0.5);  // as wide as it is far
  const std::string angle_x = "\"camera_angle_x\": " + std::to_string(angle);
  const FileCamera sized = sound("{" + angle_x + R"(, "w": 800.0, "h": 600, )" + pose);
  EXPECT_NEAR(sized.fx_px, 800, 1e-2);
  EXPECT_NEAR(sized.fy_px, 800, 1e-2);
  EXPECT_EQ(sized.cx_px, 400);
  EXPECT_EQ(sized.cy_px, 300);
  const FileCamera open = sound("{" + angle_x + ", " + pose);
  const Result<Camera> camera = fixed_camera(open, std::nullopt, {100, 50});
  ASSERT_TRUE(camera.ok());
  EXPECT_NEAR(camera->fx_px, 100, 1e-3);
  EXPECT_NEAR(camera->fy_px, 100, 1e-3);
  EXPECT_EQ(camera->cy_px, 25.0f);
  const FileCamera own = sound(
      replaced(kNerf, "\"file_path\"", "\"fl_x\": 250, \"cx\": 100, \"k1\": 0.1, \"file_path\""));
  EXPECT_EQ(own.fx_px, 250) << "a frame's own come first";
  EXPECT_EQ(own.fy_px, 510);
  EXPECT_EQ(own.cx_px, 100);
  EXPECT_EQ(own.said, "camera 0 of 1 (00042.png), lens distortion (k1) not drawn");
}

TEST(CameraFile, NamesTheFieldThatIsWrong) {
  struct Case {
    const char *json, *from, *to, *field;
  };
  const Case cases[] = {
      {kOwn, "640", "0", "width"},
      {kOwn, "640", "1e9", "width"},
      {kOwn, "640", "\"a\"", "width"},
      {kOwn, "\"height\": 480, ", "", "width and height"},
      {kOwn, "500", "-500", "focal"},
      {kOwn, "500", "\"500\"", "intrinsics"},
      {kOwn, "500", "1e999", ""},
      {kOwn, "[500, 0, 320]", "[500, 0.1, 320]", "skew"},
      {kOwn, "intrinsics", "intrinsic", "there is no intrinsics"},
      {kOwn, "[[1, 0, 0, 0.5]", "[[2, 0, 0, 0.5]", "world_to_camera is not a rotation"},
      {kOwn, "[0, -1, 0, 1]", "[0, 1, 0, 1]", "world_to_camera is not a rotation"},
      {kOwn, "[[1, 0, 0, 0.5], ", "[", "world_to_camera"},
      {kOwn, "[0, 0, 0, 1]]", "[0, 0, 0, 2]]", "the fourth row is not [0, 0, 0, 1]"},
      {kOwn, "[0, 0, 0, 1]]", "[0, 0.9, 3, 1]]", "is the matrix transposed?"},
      {kOwn, "0.05", "0", "near"},
      {kOwn, "0.05", "[]", "near"},
      {k3dgs, "\"position\": [1, 2, 3]", "\"position\": [1, 2]", "camera 1: position"},
      {k3dgs, "\"position\": [1, 2, 3]", "\"position\": [1, 2, null]", "camera 1: position"},
      {k3dgs, "[-1, 0, 0]", "[1, 0, 0]", "camera 1: rotation is not a rotation"},
      {k3dgs, "[-1, 0, 0]", "[-1, 0]", "camera 1: rotation is not a 3x3 matrix"},
      {k3dgs, "\"fx\": 500", "\"fx\": 0", "camera 1: fx"},
      {k3dgs, "\"fy\": 510", "\"f_y\": 510", "camera 1: there is no fy"},
      {k3dgs, "\"dir/00042.png\", \"width\": 640", "\"a\"", "camera 1: there is no width"},
      {k3dgs, "{\"id\": 1", "3, {\"id\": 1", "camera 1: not an object"},
      {kNerf, "transform_matrix", "matrix", "camera 0: there is no transform_matrix"},
      {kNerf, "[0, 0, 0, 1]", "[1, 2, 3, 1]", "transform_matrix: the fourth row"},
      {kNerf, "\"fl_x\"", "\"focal\"", "neither fl_x nor camera_angle_x"},
      {kNerf, "\"fl_x\": 500", "\"camera_angle_x\": 4", "camera_angle_x is not an angle"},
      {kNerf, "\"fl_x\"", "\"camera_model\": \"OPENCV_FISHEYE\", \"fl_x\"", "OPENCV_FISHEYE"},
      {kNerf, "\"w\": 640, \"h\": 480, \"cx\": 320, ", "", "w and h"},
      {kNerf, "\"w\": 640", "\"w\": 640.5", "w is not a whole number"},
      {kNerf, "\"frames\": [", "\"frames\": [3, ", "camera 0: not an object"},
  };
  for (const Case& one : cases) {
    const std::string text = replaced(one.json, one.from, one.to);
    const Result<FileCamera> camera = parse(text, one.json == k3dgs ? "1" : "");
    ASSERT_FALSE(camera.ok()) << text;
    EXPECT_TRUE(camera.status().message().starts_with("c.json: ")) << camera.status().message();
    EXPECT_NE(camera.status().message().find(one.field), std::string::npos)
        << one.field << " in: " << camera.status().message();
    EXPECT_EQ(camera.status().message().find('\n'), std::string::npos);
  }
  for (const char* text : {"", "{", "3", "\"a\"", "null", "[]", "{\"frames\": []}",
                           "{\"frames\": 3}", "{}", "[[]]", "[null]"}) {
    EXPECT_FALSE(parse(text).ok()) << text;
  }
  EXPECT_FALSE(parse(std::string(200000, '[')).ok()) << "depth costs no stack";
}

TEST(FixedCamera, KeepsThePictureAtAnotherSize) {
  const FileCamera file = sound(kOwn);
  const Result<Camera> half = fixed_camera(file, ImageSize{320, 240}, {1, 1});
  ASSERT_TRUE(half.ok());
  EXPECT_EQ(half->fx_px, 250.0f);
  EXPECT_EQ(half->fy_px, 255.0f);
  EXPECT_EQ(half->cx_px, 160.0f);
  EXPECT_EQ(half->cy_px, 120.0f);
  const Result<Camera> other = fixed_camera(file, ImageSize{320, 320}, {1, 1});
  EXPECT_EQ(other.status().message(), "size: 320x320 has another shape than the camera's 640x480");
}

// A camera and what it sees move together: in floats of UTM coordinates the view would be off by
// half a metre.
TEST(FixedCamera, MovesWithTheSceneInDouble) {
  const std::array<double, 3> origin{500000, 4649776, 120};
  const FileCamera near = sound(k3dgs, "1");
  const FileCamera far = sound(
      replaced(k3dgs, "\"position\": [1, 2, 3]", "\"position\": [500001, 4649778, 123]"), "1");
  const Result<Camera> here = fixed_camera(near, std::nullopt, {1, 1}),
                       there = fixed_camera(far, std::nullopt, {1, 1}, origin);
  ASSERT_TRUE(here.ok() && there.ok());
  EXPECT_EQ(here->view_from_world, there->view_from_world);
}

}  // namespace
}  // namespace figurine::samples::camera_file_test
