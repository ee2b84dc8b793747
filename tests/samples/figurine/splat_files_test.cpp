// Files of Gaussians and cameras as people have them, by the program: the picture that is right for
// each (tests/data/cases, what.txt), and the same picture from every container
// (tests/data/gaussians).
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "ports/media/pfm.h"
#include "samples/common/image_error.h"
#include "samples/program.h"

namespace figurine::tests::splat_files_test {
namespace {

using ports::ImageF32;

const std::string kCases = FIGURINE_SOURCE_DIR "/tests/data/cases/";
const std::string kScenes = FIGURINE_SOURCE_DIR "/tests/data/gaussians/";

class SplatFiles : public testing::Test {
 protected:
  ProgramRun run(const std::string& arguments) {
    return run_figurine(arguments, {.folder = folder_.path()});
  }

  // Of `splat FILE --size 160x120 OPTIONS`; what it said is in said_.
  ImageF32 picture(const std::string& file, const std::string& options = "") {
    const ProgramRun result = run("splat '" + file + "' --size 160x120 " + options + " -o x.pfm");
    EXPECT_EQ(result.exit_code, 0) << file << "\n" << result.err;
    said_ = result.err;
    const std::string bytes = folder_.read("x.pfm");
    Result<ImageF32> image = ports::decode_pfm(std::as_bytes(std::span(bytes)), "x.pfm");
    EXPECT_TRUE(image.ok()) << image.status().message();
    return image.ok() ? std::move(image).value() : ImageF32{};
  }
  ImageF32 picture_of_case(const std::string& name, const std::string& options = "") {
    return picture(kCases + name + "/in.ply", options);
  }

  static double psnr(const ImageF32& a, const ImageF32& b) {
    samples::ErrorSum error;
    samples::add_foreground_error(a, b, error);
    EXPECT_GT(error.values, 3000u);
    return error.psnr_db();
  }

  static std::array<float, 4> pixel(const ImageF32& image, size_t x, size_t y) {
    std::array<float, 4> rgba{};
    std::copy_n(&image.pixels[4 * (y * image.width_px + x)], 4, rgba.begin());
    return rgba;
  }
  static bool is_green(const std::array<float, 4>& p) {
    return p[3] > 0.5f && p[1] > p[0] + 0.2f && p[1] > p[2] + 0.2f;
  }

  bool said(const std::string& words) const { return said_.find(words) != std::string::npos; }

  TestFolder folder_;
  std::string said_;
};

TEST_F(SplatFiles, TheReferenceIsWhollyInThePicture) {
  const ImageF32 image = picture_of_case("ply-reference", "--up +y");
  EXPECT_EQ(said_, "figurine: " + kCases +
                       "ply-reference/in.ply: 441 Gaussians of degree 0 (ply), up +y\n");
  size_t seen = 0, border = 0;
  for (size_t y = 0; y < 120; ++y) {
    for (size_t x = 0; x < 160; ++x) {
      const bool opaque = pixel(image, x, y)[3] > 0.5f;
      seen += opaque;
      border += opaque && (x < 3 || x >= 157 || y < 3 || y >= 117);
    }
  }
  EXPECT_EQ(border, 0u) << "nothing is cropped";
  EXPECT_GT(seen, 100u * 100u * 6 / 10) << "and the picture is filled";
  EXPECT_TRUE(is_green(pixel(image, 112, 28))) << "x to the right, y up: from the front";
  EXPECT_FALSE(is_green(pixel(image, 112, 92)));
}

TEST_F(SplatFiles, WhatChangesNothingGivesTheReference) {
  const ImageF32 reference = picture_of_case("ply-reference");
  for (const auto& [name, least_db] : {std::pair("ply-comment-utf8", 200.0),
                                       {"ply-crlf-binary", 200.0},
                                       {"ply-list", 200.0},
                                       {"ply-zero-quat", 120.0},
                                       {"ply-outliers-1e30", 120.0},
                                       {"ply-rgb-mode", 45.0},  // colours in eight bits
                                       {"ply-utm-double", 60.0},
                                       {"ply-far-2km", 40.0}}) {
    const double db = psnr(reference, picture_of_case(name));
    std::printf("%s %.1f dB\n", name, db);
    EXPECT_GE(db, least_db) << name;
  }
}

// Nine tenths of it within no distance at all: what is far is told by the Gaussians' own size.
TEST_F(SplatFiles, ASceneInOnePlaceIsNotLostToItsStrays) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 20\nproperty float x\nproperty float y\n"
      "property float z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
      "property float opacity\nproperty float scale_0\nend_header\n";
  for (int i = 0; i < 19; ++i) text += "1 2 3 1 0 0 4 -3\n";
  folder_.write("place.ply", text + "1e30 2 3 1 0 0 4 -3\n");
  const ImageF32 image = picture("place.ply");
  EXPECT_TRUE(said("one scale, the same along all axes")) << said_;
  EXPECT_GT(pixel(image, 80, 60)[3], 0.9f);
  EXPECT_EQ(pixel(image, 2, 2)[3], 0.0f);
}

TEST_F(SplatFiles, SayWhatWasTakenForGranted) {
  picture_of_case("ply-zero-quat");
  EXPECT_TRUE(said("441 without a rotation (quaternion 0), left unrotated")) << said_;
  picture_of_case("ply-list");
  EXPECT_TRUE(said("skipped 'obs' (a list)")) << said_;
  picture_of_case("ply-rgb-mode");
  EXPECT_TRUE(said("colours of red green blue")) << said_;
  picture_of_case("ply-utm-double");
  EXPECT_TRUE(said("origin 500000 4649776 120")) << said_;
  picture_of_case("ply-far-2km");
  EXPECT_TRUE(said("origin 2000 0 2000")) << said_;
  picture_of_case("ply-reference");
  EXPECT_TRUE(said("up -y (assumed)")) << said_;
}

TEST_F(SplatFiles, AnOriginIsKeptByExport) {
  const ProgramRun result = run("export '" + kCases + "ply-utm-double/in.ply' --json -o x.ply");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("origin 500000 4649776 120"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(result.out)["origin"],
            nlohmann::json({500000.0, 4649776.0, 120.0}));
  const ImageF32 original = picture_of_case("ply-utm-double");
  EXPECT_GE(psnr(original, picture(folder_.path("x.ply"))), 100);
  EXPECT_TRUE(said("origin 500000 4649776 120"));
}

// A camera in the file's coordinates, of UTM.
TEST_F(SplatFiles, CamerasMoveWithTheOrigin) {
  const auto camera = [](const std::string& position) {
    return R"([{"position": [)" + position + R"(], "rotation": [[1,0,0],[0,-1,0],[0,0,-1]],
        "fx": 200, "fy": 200, "width": 160, "height": 120}])";
  };
  folder_.write("near.json", camera("0.1, 0.2, 2"));
  folder_.write("far.json", camera("500000.1, 4649776.2, 122"));
  const ImageF32 near = picture_of_case("ply-reference", "--camera near.json");
  EXPECT_GE(psnr(near, picture_of_case("ply-utm-double", "--camera far.json")), 60);
}

TEST_F(SplatFiles, AntialiasedScenesAreDrawnSo) {
  const auto light = [](const ImageF32& image) {
    double sum = 0;
    for (size_t i = 3; i < image.pixels.size(); i += 4) sum += image.pixels[i];
    return sum;
  };
  const ImageF32 as_said = picture_of_case("ply-antialiased-comment");
  EXPECT_TRUE(said(", antialiased")) << said_;
  EXPECT_EQ(picture_of_case("ply-antialiased-comment", "--antialiased").pixels, as_said.pixels);
  const ImageF32 without = picture_of_case("ply-antialiased-comment", "--no-antialiased");
  EXPECT_FALSE(said(", antialiased")) << said_;
  EXPECT_GT(light(as_said), 0);
  EXPECT_LT(light(as_said), 0.2 * light(without)) << "dots of a fifth of a pixel";
}

// (0.001 / 0.03)^3 of the opacity is left: nothing that an eight-bit picture has.
TEST_F(SplatFiles, AnUnfusedFilterIsFused) {
  const ImageF32 image = picture_of_case("ply-mip-filter3d");
  for (size_t i = 3; i < image.pixels.size(); i += 4) ASSERT_EQ(image.pixels[i], 0.0f);
  EXPECT_TRUE(said("filter_3D fused")) << said_;
  EXPECT_TRUE(said("no Gaussian is in the picture")) << said_;
  picture_of_case("ply-mip-filter3d", "--alpha-cut 1e-6");
  EXPECT_FALSE(said("no Gaussian is in the picture")) << said_;
}

TEST_F(SplatFiles, YDownScenesAreUpright) {
  const ImageF32 image = picture_of_case("ply-ydown");
  EXPECT_TRUE(is_green(pixel(image, 112, 28)));
  EXPECT_FALSE(is_green(pixel(image, 112, 92)));
  EXPECT_TRUE(said("up -y (assumed)"));
}

TEST_F(SplatFiles, ACutFileIsRefused) {
  const ProgramRun result = run("splat '" + kCases + "ply-truncated/in.ply' -o x.png");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.error_lines(), 1u);
  EXPECT_NE(result.err.find("declares 441 vertices, the data holds at most 217"), std::string::npos)
      << result.err;
  EXPECT_TRUE(folder_.names().empty());
}

// Of three Gaussians only the middle one is there: the others' logits are minus infinity.
TEST_F(SplatFiles, ALogitBeyondFloatsGoesByItsSign) {
  const ImageF32 image = picture_of_case("ascii-opacity-overflow", "--camera orbit:0,0,1");
  EXPECT_TRUE(said("3 Gaussians of degree 0")) << said_;
  EXPECT_GT(pixel(image, 80, 60)[3], 0.5f);
  for (size_t y = 0; y < 120; ++y) {
    for (const size_t x : {size_t{20}, size_t{35}, size_t{125}, size_t{140}})
      ASSERT_EQ(pixel(image, x, y)[3], 0.0f) << x << " " << y;
  }
}

TEST_F(SplatFiles, ATransposedCameraIsRefused) {
  const ProgramRun result = run("splat '" + kCases + "ply-reference/in.ply' --camera '" + kCases +
                                "camera-transposed/in.json' -o x.png");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("world_to_camera: the fourth row is not [0, 0, 0, 1]"),
            std::string::npos)
      << result.err;
  EXPECT_TRUE(folder_.names().empty());
}

TEST_F(SplatFiles, CamerasOf3dgsAndOfNerfsGiveTheirView) {
  const std::string folder = kCases + "cameras-json/";
  const ImageF32 view = picture_of_case("ply-reference", "--camera '" + folder + "cameras.json'");
  EXPECT_TRUE(said("camera 0 of 1 (00001)")) << said_;
  // At (0.4, 0.4), three metres away, with 500 px of 640 focal length, y down.
  EXPECT_TRUE(is_green(pixel(view, 80 + 17, 60 + 17)));
  EXPECT_FALSE(is_green(pixel(view, 80 + 17, 60 - 17)));
  const std::string again[] = {folder + "cameras.json#0", folder + "cameras.json#00001",
                               folder + "transforms.json", folder + "transforms.json#a"};
  for (const std::string& camera : again)
    EXPECT_EQ(picture_of_case("ply-reference", "--camera '" + camera + "'").pixels, view.pixels)
        << camera;
  const ProgramRun result = run("splat '" + kCases + "ply-reference/in.ply' --camera '" + folder +
                                "cameras.json#1' -o y.png");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("camera 1: there are 1"), std::string::npos) << result.err;
}

TEST_F(SplatFiles, FromStraightAbove) {
  // An edge-on sheet from the front, a square from above.
  const ImageF32 front = picture_of_case("ply-reference", "--up +z --camera orbit:0,0,2");
  const ImageF32 above = picture_of_case("ply-reference", "--up +z --camera orbit:0,90,2");
  const auto seen = [](const ImageF32& image) {
    size_t count = 0;
    for (size_t i = 3; i < image.pixels.size(); i += 4) count += image.pixels[i] > 0.5f;
    return count;
  };
  EXPECT_GT(seen(above), 8 * seen(front));
  EXPECT_TRUE(is_green(pixel(above, 80 + 33, 60 - 33)));
}

// One scene in every container, up to the steps in which each stores it.
TEST_F(SplatFiles, EveryContainerGivesTheSamePicture) {
  const ImageF32 plain = picture(kScenes + "scene.ply");
  EXPECT_EQ(picture(kScenes + "scene.ply", "--up -y").pixels, plain.pixels);
  for (const auto& [name, degree, least_db] : {std::tuple("scene.compressed.ply", 3, 40.0),
                                               {"scene.v3.spz", 3, 32.0},
                                               {"scene.v4.spz", 3, 32.0}}) {
    const double db = psnr(plain, picture(kScenes + name));
    std::printf("%s %.1f dB\n", name, db);
    EXPECT_GE(db, least_db) << name;
    EXPECT_TRUE(said("260 Gaussians of degree " + std::to_string(degree))) << said_;
    EXPECT_TRUE(said("up -y (assumed)")) << said_;
  }
  // .splat has no harmonics: against the plain one without its own, which export of .splat is.
  const ImageF32 splat = picture(kScenes + "scene.splat");
  ASSERT_EQ(run("export '" + kScenes + "scene.splat' -o flat.ply").exit_code, 0);
  EXPECT_GE(psnr(splat, picture(folder_.path("flat.ply"))), 100);
  const double db = psnr(plain, splat);
  std::printf("scene.splat, without harmonics %.1f dB\n", db);
  EXPECT_GE(db, 20);
}

TEST_F(SplatFiles, ExportRefusesWhatFilesOfGaussiansHaveNot) {
  for (const char* option : {"--frame 3", "--body b.fgn", "--motion m.fgn"}) {
    const ProgramRun result = run("export '" + kScenes + "scene.splat' " + option + " -o x.ply");
    EXPECT_EQ(result.exit_code, 1) << option;
    EXPECT_NE(result.err.find("has neither --body, --motion nor --frame"), std::string::npos);
  }
  EXPECT_TRUE(folder_.names().empty());
}

}  // namespace
}  // namespace figurine::tests::splat_files_test
