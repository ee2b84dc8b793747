// Captures as people have them (tests/data/cases/mv-*): the right value, or a refusal that names
// the field; and further members of each kind.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>

#include "toolchain/body/mannequin.h"
#include "toolchain/body/smplx.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::capture_cases_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::input_error;
using test::TemporaryFolder;

Dataset open(const std::string& path) {
  static const body::TexelBody texels = body::make_texel_body(body::make_mannequin(), 32);
  static const Body body = texels.view();
  return Dataset::open(path, {.body = &body});
}
std::string a_case(const std::string& name) { return FIGURINE_CASES "/" + name + "/ID"; }

bool has_remark(const Dataset& data, const std::string& words) {
  return std::any_of(data.remarks().begin(), data.remarks().end(), [&](const std::string& line) {
    return line.find(words) != std::string::npos;
  });
}

// The reference, to be changed.
class Changed {
 public:
  Changed() {
    fs::copy(a_case("mv-reference"), folder_.path(), fs::copy_options::recursive);
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
      fs::permissions(entry.path(), fs::perms::owner_all);
  }
  std::string path() const { return folder_.path(); }
  std::string operator/(const std::string& name) const { return folder_ / name; }

  template <class F>
  void edit(const std::string& name, const F& f) {
    json value = json::parse(test::read_text(folder_ / name));
    f(value);
    test::write_text(folder_ / name, value.dump());
  }

 private:
  TemporaryFolder folder_;
};

TEST(CaptureCases, Reference) {
  const Dataset data = open(a_case("mv-reference"));
  EXPECT_EQ(data.cameras().size(), 2u);
  EXPECT_EQ(data.frames().size(), 3u);
  EXPECT_EQ(data.cameras()[0].camera.fx_px, 75);
  EXPECT_EQ(data.cameras()[0].camera.cx_px, 32);
  EXPECT_TRUE(data.remarks().empty());
}

TEST(CaptureCases, DistortionIsTakenOutOfImagesAndMasks) {
  const Dataset bent = open(a_case("mv-distortion"));
  ASSERT_TRUE(bent.cameras()[0].lens.bends());
  EXPECT_EQ(bent.cameras()[0].lens.k[0], -0.21);
  EXPECT_TRUE(has_remark(bent, "straightened"));
  // Barrel distortion shows a corner's content nearer the middle: straightened, what lay there goes
  // outwards, the middle stays.
  Changed changed;
  ports::ImageU8 mask(64, 48, 1);
  for (uint32_t y = 20; y < 28; ++y) {
    for (uint32_t x = 2; x < 62; ++x) *mask.at(x, y) = x < 6 || (x > 28 && x < 36) ? 255 : 0;
  }
  test::write_bytes(changed / "fmask_lr/CAMA/0005_img_fmask.png", ports::encode_png(mask).value());
  const std::vector<uint8_t> before = open(changed.path()).load_image(0, 0).alpha;
  changed.edit("camera_intrinsics.json", [](json& j) { j["dist"] = {-0.21, 0.08, 0, 0, 0}; });
  const std::vector<uint8_t> after = open(changed.path()).load_image(0, 0).alpha;
  const auto row = [](const std::vector<uint8_t>& alpha, size_t x) { return alpha[24 * 64 + x]; };
  EXPECT_EQ(row(before, 5), 255);
  EXPECT_LT(row(after, 5), 128);
  EXPECT_GE(row(after, 1), 240);
  EXPECT_EQ(row(after, 32), 255);
}

TEST(CaptureCases, DistortionOfOtherModelsNamesTheField) {
  for (const std::vector<double>& dist :
       {std::vector<double>{0.1}, std::vector<double>(6, 0.01), std::vector<double>(14, 0.01)}) {
    Changed changed;
    changed.edit("camera_intrinsics.json", [&](json& j) { j["dist"] = dist; });
    EXPECT_NE(input_error([&] { open(changed.path()); }).find("camera_intrinsics.json: dist"),
              std::string::npos);
  }
  Changed nested;  // as OpenCV's arrays are written
  nested.edit("camera_intrinsics.json", [](json& j) { j["dist"] = {{-0.2, 0.05, 0, 0, 0}}; });
  EXPECT_EQ(open(nested.path()).cameras()[0].lens.k[1], 0.05);
}

TEST(CaptureCases, ACamerasOwnLensIsItsOwn) {
  Changed changed;
  changed.edit("camera_extrinsics.json", [](json& j) {
    j["2_CAMB.png"]["focal_length"] = {200, 190};
    j["2_CAMB.png"]["image_center"] = {70, 44};
    j["2_CAMB.png"]["dist"] = {0.1, 0, 0, 0};
  });
  const Dataset data = open(changed.path());
  EXPECT_EQ(data.cameras()[0].camera.fx_px, 75);
  EXPECT_FALSE(data.cameras()[0].lens.bends());
  const Camera& own = data.cameras()[1].camera;
  EXPECT_EQ(own.fx_px, 100);
  EXPECT_EQ(own.fy_px, 95);
  EXPECT_EQ(own.cx_px, 35);
  EXPECT_EQ(own.cy_px, 22);
  EXPECT_TRUE(data.cameras()[1].lens.bends());
}

TEST(CaptureCases, WithoutItsOwnACameraHasTheSharedLens) {
  Changed changed;
  changed.edit("camera_extrinsics.json", [](json& j) {
    for (auto& camera : j) camera.erase("focal_length"), camera.erase("image_center");
  });
  changed.edit("camera_intrinsics.json", [](json& j) { j["intrinsics"][1][1] = 160; });
  EXPECT_EQ(open(changed.path()).cameras()[0].camera.fy_px, 80);
}

TEST(CaptureCases, ImagesAndMasksUnderTheirOtherNames) {
  const Dataset data = open(a_case("mv-images"));
  EXPECT_EQ(data.cameras()[0].camera.cx_px, 32) << "of half the size of the intrinsics";
  EXPECT_EQ(data.load_image(0, 0).width_px, 64u);
}

TEST(CaptureCases, ImagesOfFullSizeKeepTheirIntrinsics) {
  Changed changed;
  changed.edit("camera_extrinsics.json", [](json& j) {
    for (auto& camera : j) camera["image_center"] = {32, 24}, camera["focal_length"] = {75, 75};
  });
  const Dataset data = open(changed.path());
  EXPECT_EQ(data.cameras()[0].camera.cx_px, 32);
  EXPECT_EQ(data.cameras()[0].camera.fx_px, 75);
  EXPECT_TRUE(has_remark(data, "size of the intrinsics"));
}

TEST(CaptureCases, ExpectedFoldersAreNamed) {
  Changed changed;
  fs::rename(changed / "fmask_lr", changed / "alpha");
  EXPECT_NE(input_error([&] { open(changed.path()); }).find("fmask_lr, fmask"), std::string::npos);
}

TEST(CaptureCases, AMissingImageIsLeftOutAndCounted) {
  const Dataset data = open(a_case("mv-missing-image"));
  ASSERT_EQ(data.frames().size(), 3u);
  EXPECT_EQ(data.images_left_out(), 1u);
  EXPECT_TRUE(has_remark(data, "1 image missing"));
  EXPECT_EQ(data.role(1, 1), Role::kMissing);
  EXPECT_EQ(data.role(1, 0), Role::kTrain);
  EXPECT_EQ(data.role(2, 1), Role::kTrain);
  EXPECT_NE(input_error([&] { (void)data.load_image(1, 1); }).find("missing"), std::string::npos);
  EXPECT_EQ(data.camera_with_image(1, 1), 0u);
}

TEST(CaptureCases, SoIsAnImageWithoutAMaskAndOneOfTheFirstCamera) {
  Changed changed;
  fs::remove(changed / "fmask_lr/CAMB/0015_img_fmask.png");
  fs::remove(changed / "images_lr/CAMA/0005_img.jpg");
  const Dataset data = open(changed.path());
  EXPECT_EQ(data.frames().size(), 3u);
  EXPECT_EQ(data.images_left_out(), 2u);
  fs::remove_all(changed / "fmask_lr/CAMA");
  fs::remove_all(changed / "fmask_lr/CAMB");
  EXPECT_NE(input_error([&] { open(changed.path()); }).find("no image has a mask"),
            std::string::npos);
}

TEST(CaptureCases, ThePersonIsId0WhereverItStands) {
  const Dataset data = open(a_case("mv-two-people")), alone = open(a_case("mv-reference"));
  for (size_t f = 0; f < 3; ++f)
    EXPECT_EQ(data.frames()[f].root_translation_m, alone.frames()[f].root_translation_m);
}

TEST(CaptureCases, AFrameOfTheBystanderAloneIsNoFrameOfThePerson) {
  Changed changed;
  changed.edit("smplx/smpl/000001.json", [](json& j) { j[0]["id"] = 1; });
  const Dataset data = open(changed.path());
  EXPECT_EQ(data.frames().size(), 2u);
  EXPECT_EQ(data.frames_without_pose(), 1u);
}

TEST(CaptureCases, SeveralPeopleWithoutId0AreRefused) {
  Changed several, twice, other;
  const auto add = [](int first, int second) {
    return [first, second](json& j) {
      j.push_back(j[0]);
      j[0]["id"] = first, j[1]["id"] = second;
    };
  };
  several.edit("smplx/smpl/000001.json", add(1, 2));
  for (const char* file : {"smplx/smpl/000000.json", "smplx/smpl/000002.json"})
    several.edit(file, [](json& j) { j[0]["id"] = 1; });
  EXPECT_NE(input_error([&] { open(several.path()); }).find("id"), std::string::npos);
  twice.edit("smplx/smpl/000001.json", add(0, 0));
  EXPECT_NE(input_error([&] { open(twice.path()); }).find("two people"), std::string::npos);
  // One person throughout, under another number: that one.
  for (const char* file :
       {"smplx/smpl/000000.json", "smplx/smpl/000001.json", "smplx/smpl/000002.json"})
    other.edit(file, [](json& j) { j[0]["id"] = 7; });
  EXPECT_EQ(open(other.path()).frames().size(), 3u);
}

TEST(CaptureCases, CamerasThatSeeNobodyAreSaidOrRefused) {
  const auto move = [](json& camera, double z) { camera["translation"] = {0, 0, z}; };
  Changed one, all, behind;
  one.edit("camera_extrinsics.json", [&](json& j) { move(j["2_CAMB.png"], 1e9); });
  const Dataset data = open(one.path());
  EXPECT_EQ(data.cameras().size(), 1u);
  EXPECT_EQ(data.cameras_left_out(), 1u);
  EXPECT_TRUE(has_remark(data, "CAMB"));
  for (const double z : {1e9, -3.0, 3000.0}) {  // far, behind, millimetres
    all.edit("camera_extrinsics.json", [&](json& j) {
      for (auto& camera : j) move(camera, z);
    });
    EXPECT_NE(input_error([&] { open(all.path()); }).find("no camera sees the person"),
              std::string::npos)
        << z;
  }
}

TEST(CaptureCases, ShapesThatAreNoPersonsAreRefused) {
  Changed huge, five;
  huge.edit("smplx/smpl/000000.json", [](json& j) { j[0]["shapes"][0][0] = 1e30; });
  EXPECT_NE(input_error([&] { open(huge.path()); }).find("shapes"), std::string::npos);
  five.edit("smplx/smpl/000000.json", [](json& j) { j[0]["shapes"] = {{1, 2, 3, 4, 5}}; });
  EXPECT_NE(input_error([&] { open(five.path()); }).find("has 5 numbers"), std::string::npos);
}

TEST(CaptureCases, RotationsInDegreesAreRefused) {
  Changed changed;
  changed.edit("smplx/smpl/000000.json", [](json& j) { j[0]["Rh"] = {{0, 90, 0}}; });
  EXPECT_NE(input_error([&] { open(changed.path()); }).find("degrees"), std::string::npos);
}

TEST(CaptureCases, BlankMasksAreSaidAndAllOfThemRefused) {
  Changed changed;
  const auto blank = [&](const std::string& camera) {
    for (const char* frame : {"0005", "0010", "0015"})
      test::write_bytes(changed / ("fmask_lr/" + camera + "/" + frame + "_img_fmask.png"),
                        ports::encode_png(ports::ImageU8(64, 48, 1)).value());
  };
  blank("CAMB");
  Dataset data = open(changed.path());
  data.leave_out_blank_cameras();
  EXPECT_TRUE(has_remark(data, "blank, left out: CAMB"));
  EXPECT_EQ(data.role(0, 1), Role::kMissing);
  EXPECT_EQ(data.role(0, 0), Role::kTrain);
  blank("CAMA");
  Dataset none = open(changed.path());
  EXPECT_NE(input_error([&] { none.leave_out_blank_cameras(); }).find("all masks are blank"),
            std::string::npos);
}

TEST(CaptureCases, PngColoursAreRead) {
  Changed changed;
  const std::string png(FIGURINE_PICTURES "/colour.png");
  for (const char* camera : {"CAMA", "CAMB"}) {
    for (const char* frame : {"0005", "0010", "0015"}) {
      const std::string stem = changed / (std::string("images_lr/") + camera + "/" + frame);
      fs::remove(stem + "_img.jpg");
      ports::ImageU8 image(64, 48, 3);
      std::fill(image.pixels.begin(), image.pixels.end(), uint8_t{90});
      test::write_bytes(stem + "_img.PNG", ports::encode_png(image).value());
    }
  }
  const CaptureImage image = open(changed.path()).load_image(0, 0);
  EXPECT_EQ(*std::max_element(image.rgb.begin(), image.rgb.end()), 90);
}

// What it declares is judged before it is unpacked: the 330 MB of this file never are.
TEST(CaptureCases, AnArchiveThatDeclaresGigabytesIsNotUnpacked) {
  const auto peak_kb = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
  };
  const long before = peak_kb();
  const std::string message =
      input_error([] { body::read_smplx(FIGURINE_CASES "/smplx-bomb/in.npz"); });
  EXPECT_NE(message.find("v_template: "), std::string::npos) << message;
  EXPECT_NE(message.find("declares"), std::string::npos) << message;
  EXPECT_LT(peak_kb() - before, 32 * 1024);
}

}  // namespace
}  // namespace figurine::dataset::capture_cases_test
