// EasyMocap's layout, made file by file, with the peculiarities of its own writers.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::easymocap_test {
namespace {

using nlohmann::json;
using test::input_error;
using test::TemporaryFolder;
using test::write_text;

const Body& mannequin() {
  static const body::TexelBody texels = body::make_texel_body(body::make_mannequin(), 32);
  static const Body body = texels.view();
  return body;
}
Dataset open(const std::string& path, const ModelOrigin& origin = {}) {
  return Dataset::open(path, {.body = &mannequin(), .origin = origin});
}

const char* const kIntri =
    "%YAML:1.0\n---\nnames:\n   - \"01\"\n   - \"02\"\n"
    "K_01: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 40., 0., 1.55e+01, 0., 41.,\n       11.5, 0., 0., 1. ]\n"
    "dist_01: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n"
    "K_02: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 40, 0, 15.5, 0, 40, 11.5, 0, 0, 1 ]\n"
    "dist_02: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ -0.1, 0., 0., 0., 0. "
    "]\n";
// The second camera half a turn about y behind the person, as rotation vector alone.
const char* const kExtri =
    "%YAML:1.0\r\n---\r\nnames:\r\n- '01'\r\n- '02'\r\n"
    "R_01: !!opencv-matrix\r\n  rows: 3\r\n  cols: 1\r\n  dt: d\r\n"
    "  data: [3.141592653589793, 0., 0.]\r\n"
    "Rot_01: !!opencv-matrix\r\n  rows: 3\r\n  cols: 3\r\n  dt: d\r\n"
    "  data: [1.,0.,0.,0.,-1.,0.,0.,0.,-1.]\r\n"
    "T_01: !!opencv-matrix\r\n  rows: 3\r\n  cols: 1\r\n  dt: d\r\n  data: [0., 1., 3.]\r\n"
    "R_02: !!opencv-matrix\r\n  rows: 3\r\n  cols: 1\r\n  dt: d\r\n"
    "  data: [0., 0., 3.141592653589793]\r\n"
    "T_02: !!opencv-matrix\r\n  rows: 3\r\n  cols: 1\r\n  dt: d\r\n  data: [0., 1., 3.]\r\n";

json person(size_t numbers, std::vector<double> rh = {0, 0, 0},
            std::vector<double> th = {0, 0, 0}) {
  std::vector<double> poses(numbers, 0.0);
  poses[(numbers == 63 || numbers == 69 ? 0 : 3) + 3 * 3 + 1] = 0.4;  // joint 4 about y
  return {{"id", 0},
          {"Rh", {rh}},
          {"Th", {th}},
          {"poses", {poses}},
          {"shapes", {std::vector<double>(10, 0.0)}}};
}

void write_capture(const TemporaryFolder& folder, const json& people,
                   const std::string& poses = "output/smpl/smpl") {
  write_text(folder / "intri.yml", kIntri);
  write_text(folder / "extri.yml", kExtri);
  for (const char* camera : {"01", "02"}) {
    for (int frame = 0; frame < 3; ++frame) {
      const std::string name = std::string("/") + camera + "/00000" + std::to_string(frame);
      write_text(folder / ("images" + name + ".jpg"), "");
      test::write_bytes(folder / ("images" + name + ".jpg"),
                        ports::encode_jpeg(test::plain_image(120), 95).value());
      write_text(folder / ("mask" + name + ".png"), "");
      test::write_bytes(folder / ("mask" + name + ".png"),
                        ports::encode_png(test::left_half_mask()).value());
    }
  }
  for (int frame = 0; frame < 3; ++frame)
    write_text(folder / (poses + "/00000" + std::to_string(frame) + ".json"), people.dump());
}

TEST(EasyMocap, ReadsCamerasWithTheirPixelCentres) {
  const TemporaryFolder folder;
  write_capture(folder, {person(87)});
  const Dataset data = open(folder.path());
  ASSERT_EQ(data.cameras().size(), 2u);
  EXPECT_EQ(data.frames().size(), 3u);
  const Camera& first = data.cameras()[0].camera;
  EXPECT_EQ(first.width_px, test::kWidth);
  EXPECT_EQ(first.fx_px, 40);
  EXPECT_EQ(first.fy_px, 41);
  EXPECT_EQ(first.cx_px, 16) << "OpenCV counts from the middle of the first pixel";
  EXPECT_EQ(first.cy_px, 12);
  EXPECT_EQ(first.view_from_world, (std::array<float, 12>{1, 0, 0, 0, 0, -1, 0, 1, 0, 0, -1, 3}));
  EXPECT_FALSE(data.cameras()[0].lens.bends());
  EXPECT_EQ(data.cameras()[1].lens.k[0], -0.1);
  const Camera& second = data.cameras()[1].camera;
  const std::array<float, 12> turned{-1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 1, 3};
  for (size_t i = 0; i < 12; ++i) EXPECT_NEAR(second.view_from_world[i], turned[i], 1e-6) << i;
}

TEST(EasyMocap, ReadsPosesOfEveryLength) {
  for (const size_t numbers : {63, 66, 69, 72, 78, 87, 156, 165}) {
    const TemporaryFolder folder;
    write_capture(folder, {person(numbers)});
    const std::vector<float> q = open(folder.path()).frames()[0].rotations;
    EXPECT_NEAR(q[4 * 4 + 0], std::cos(0.2), 1e-6) << numbers;
    EXPECT_NEAR(q[4 * 4 + 2], std::sin(0.2), 1e-6) << numbers;
    for (const size_t joint : {0u, 3u, 5u, 22u, 30u}) EXPECT_EQ(q[joint * 4], 1) << numbers;
  }
  const TemporaryFolder folder;
  write_capture(folder, {person(75)});
  EXPECT_NE(input_error([&] { open(folder.path()); }).find("poses: has 75 numbers"),
            std::string::npos);
}

TEST(EasyMocap, ReadsFingersOfFullPoses) {
  json full = person(165);
  full["poses"][0][75] = 0.6;  // left index, first joint, about x
  full["poses"][0][66] = 0.2;  // jaw
  const TemporaryFolder folder;
  write_capture(folder, {full});
  const std::vector<float> q = open(folder.path()).frames()[0].rotations;
  EXPECT_NEAR(q[25 * 4 + 1], std::sin(0.3), 1e-6);
  EXPECT_NEAR(q[22 * 4 + 1], std::sin(0.1), 1e-6);
}

TEST(EasyMocap, FindsPosesInEveryFolderAndList) {
  for (const char* poses : {"output/smplx", "output/smpl", "output-smpl-3d/smplfull", "smplx"}) {
    const TemporaryFolder folder;
    write_capture(folder, {{"annots", {person(87)}}}, poses);
    EXPECT_EQ(open(folder.path()).frames().size(), 3u) << poses;
  }
  const TemporaryFolder folder;
  write_capture(folder, {person(87)}, "elsewhere");
  EXPECT_NE(input_error([&] { open(folder.path()); }).find("no poses"), std::string::npos);
}

// World point = R (x - origin) + Th for a model whose origin is not the body's.
TEST(EasyMocap, RhTurnsAboutTheModelsOriginAndGlobalOrientAboutThePelvis) {
  const ModelOrigin origin{.position_m = {0, 1.25, 0}, .smplx = true};
  const std::array<double, 3> root = root_rest_position(mannequin(), {});
  const double angle = 0.7;
  const TemporaryFolder about_origin, about_pelvis;
  write_capture(about_origin, {person(87, {0, 0, angle}, {0.1, 1.2, 0.3})});
  const auto moved = open(about_origin.path(), origin).frames()[0].root_translation_m;
  const double x = root[0], y = root[1] - 1.25;
  EXPECT_NEAR(root[0] + moved[0], std::cos(angle) * x - std::sin(angle) * y + 0.1, 1e-6);
  EXPECT_NEAR(root[1] + moved[1], std::sin(angle) * x + std::cos(angle) * y + 1.2, 1e-6);
  json authors = {{"global_orient", {0, 0, angle}},
                  {"transl", {0.1, 1.2, 0.3}},
                  {"body_pose", std::vector<double>(63, 0.0)},
                  {"betas", std::vector<double>(10, 0.0)}};
  write_capture(about_pelvis, authors);
  const CaptureFrame frame = open(about_pelvis.path(), origin).frames()[0];
  EXPECT_NEAR(frame.root_translation_m[1], 1.2 - 1.25, 1e-6);
  EXPECT_NEAR(frame.rotations[0], std::cos(angle / 2), 1e-6);
}

TEST(EasyMocap, ShapesOfSmplAreNotTakenForThoseOfSmplx) {
  json smpl = person(72);
  smpl["shapes"][0][0] = 2;
  const TemporaryFolder folder;
  write_capture(folder, {smpl});
  const Dataset data = open(folder.path(), {.position_m = {0, 1.25, 0}, .smplx = true});
  EXPECT_TRUE(data.shape().empty());
  ASSERT_FALSE(data.remarks().empty());
  EXPECT_NE(data.remarks()[0].find("SMPL's"), std::string::npos);
}

TEST(EasyMocap, DamageIsNamedWithFileAndField) {
  struct Damage {
    const char *file, *from, *to, *words;
  };
  const Damage damages[] = {
      {"intri.yml", "K_01:", "K_1:", "K_01: missing"},
      {"intri.yml", "rows: 3", "rows: 4", "is of 4 x 3"},
      {"intri.yml", "1.55e+01", "15,5", "K_01"},
      {"intri.yml", "1.55e+01", "1550", "principal point"},
      {"intri.yml", "0., 0., 1. ]", "15., 11., 1. ]", "transposed"},
      {"intri.yml", "40., 0.,", "40., 3.,", "skew"},
      {"intri.yml", "[ -0.1,", "[ -30,", "dist_02: folds"},
      {"intri.yml", "\"02\"", "\"01\"", "stands twice"},
      {"intri.yml", "\"02\"", "\"../02\"", "no folder's name"},
      {"intri.yml", "1. ]\ndist", "1.\ndist", "intri.yml"},
      {"extri.yml", "T_01:", "T_1:", "T_01: missing"},
      {"extri.yml", "[1.,0.,0.,", "[1.,1.,0.,", "extri.yml: camera 01"},
      {"extri.yml", "[0., 1., 3.]", "[0., 1., nan]", "T_01"},
  };
  for (const Damage& damage : damages) {
    const TemporaryFolder folder;
    write_capture(folder, {person(87)});
    std::string text = test::read_text(folder / damage.file);
    const size_t at = text.find(damage.from);
    ASSERT_NE(at, std::string::npos) << damage.from;
    write_text(folder / damage.file, text.replace(at, std::string(damage.from).size(), damage.to));
    const std::string message = input_error([&] { open(folder.path()); });
    EXPECT_NE(message.find(damage.words), std::string::npos) << damage.to << ": " << message;
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(EasyMocap, AFolderThatIsNoCaptureNamesBothLayouts) {
  const TemporaryFolder folder;
  const std::string message = input_error([&] { open(folder.path()); });
  EXPECT_NE(message.find("camera_intrinsics.json"), std::string::npos);
  EXPECT_NE(message.find("intri.yml"), std::string::npos);
}

}  // namespace
}  // namespace figurine::dataset::easymocap_test
