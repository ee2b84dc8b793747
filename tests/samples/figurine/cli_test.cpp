// The program from the outside: what it writes on sound input, and that bad input gets one line,
// the right exit code and no file.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "ports/gaussians/ply_text.h"
#include "ports/media/pfm.h"
#include "ports/media/png.h"
#include "runtime/test_packages.h"
#include "samples/common/camera_spec.h"
#include "samples/common/image_error.h"
#include "samples/program.h"

namespace figurine::tests::cli_test {
namespace {

using Json = nlohmann::json;
using ports::ImageF32;
using ports::ImageU8;

class Cli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    packages_ = new TestFolder;
    write_test_packages(*packages_);
    packages_->write("scene.ply", sample_ply(1, 50));
    packages_->write("noise.fgn", std::string(5000, 'x'));
  }
  static void TearDownTestSuite() {
    delete packages_;
    packages_ = nullptr;
  }

  // Runs in an empty folder; P/ in the arguments is the folder of the packages.
  ProgramRun run(std::string arguments, RunOptions options = {}) {
    // At the beginning of a word only, and on behind what was put in: a folder's random name may
    // end in P itself.
    const std::string packages = packages_->path() + "/";
    for (size_t at = 0; (at = arguments.find("P/", at)) != std::string::npos;) {
      const bool word = at == 0 || arguments[at - 1] == ' ';
      if (word) arguments.replace(at, 2, packages);
      at += word ? packages.size() : 2;
    }
    options.folder = folder_.path();
    return run_figurine(arguments, options);
  }

  void expect_refused(const std::string& arguments, int exit_code, const std::string& reason,
                      const RunOptions& options = {}) {
    const ProgramRun result = run(arguments, options);
    EXPECT_EQ(result.exit_code, exit_code) << arguments << "\n" << result.err;
    EXPECT_EQ(result.error_lines(), 1u) << arguments << "\n" << result.err;
    EXPECT_NE(result.err.find(reason), std::string::npos) << arguments << "\n" << result.err;
    EXPECT_TRUE(folder_.names().empty()) << arguments << " left " << folder_.names().front();
    EXPECT_EQ(result.out, "");
  }

  ImageU8 png(const std::string& name) {
    const std::string bytes = folder_.read(name);
    Result<ImageU8> image = ports::decode_png(std::as_bytes(std::span(bytes)), name);
    EXPECT_TRUE(image.ok()) << image.status().message();
    return image.ok() ? std::move(image).value() : ImageU8{};
  }
  ImageF32 pfm(const std::string& name) {
    const std::string bytes = folder_.read(name);
    Result<ImageF32> image = ports::decode_pfm(std::as_bytes(std::span(bytes)), name);
    EXPECT_TRUE(image.ok()) << image.status().message();
    return image.ok() ? std::move(image).value() : ImageF32{};
  }
  static size_t visible_pixels(const ImageU8& image) {
    size_t visible = 0;
    for (size_t i = 3; i < image.pixels.size(); i += 4) visible += image.pixels[i] > 127;
    return visible;
  }

  static TestFolder* packages_;
  TestFolder folder_;
};

TestFolder* Cli::packages_ = nullptr;

TEST_F(Cli, RendersAnAvatarThatFillsThePicture) {
  const ProgramRun result = run("render P/avatar.fgn --size 96x128 -o x.png");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  const ImageU8 image = png("x.png");
  ASSERT_EQ(image.channels, 4u);
  ASSERT_EQ(image.width_px, 96u);
  ASSERT_EQ(image.height_px, 128u);
  EXPECT_GT(visible_pixels(image), 96u * 128u / 20);
  EXPECT_LT(visible_pixels(image), 96u * 128u * 9 / 10);
  EXPECT_EQ(folder_.names(), std::vector<std::string>{"x.png"});
}

TEST_F(Cli, RendersMembersOfAPopulationByNameAndByNumber) {
  ASSERT_EQ(run("render P/people.fgn#bob --size 64x64 -o a.pfm").exit_code, 0);
  const ProgramRun second = run("render P/people.fgn#1 --size 64x64 --json -o b.pfm");
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_TRUE(Json::parse(second.out)["avatars"][0].get<std::string>().ends_with("people.fgn#1"));
  EXPECT_EQ(Json::parse(second.out)["machine"]["precision"], "f32");
  EXPECT_EQ(folder_.read("a.pfm"), folder_.read("b.pfm"));
  ASSERT_EQ(run("render P/people.fgn#ada --size 64x64 -o c.pfm").exit_code, 0);
  EXPECT_NE(folder_.read("a.pfm"), folder_.read("c.pfm"));
  ASSERT_EQ(run("render P/people.fgn#ada P/people.fgn#bob P/avatar.fgn --motion P/motion.fgn "
                "--size 64x48 -o d.png")
                .exit_code,
            0);
  ASSERT_EQ(run("export P/people.fgn#0 -o x.ply").exit_code, 0);
  ASSERT_EQ(run("bench P/people.fgn#ada --frames 2 --size 32x32 --json -").exit_code, 0);
}

TEST_F(Cli, SaysWhatIsWrongWithAMember) {
  expect_refused("render P/people.fgn -o x.png", 1,
                 "people.fgn: is a population: name one of its 2 members");
  expect_refused("render P/people.fgn#2 -o x.png", 1,
                 "people.fgn: member '2': there is none of this name, and its 2 members have the "
                 "numbers 0 to 1");
  expect_refused("export P/people.fgn#zoe -o x.ply", 1, "member 'zoe'");
  expect_refused("bench P/people.fgn#", 1, "member ''");
  expect_refused("render P/avatar.fgn#0 -o x.png", 1,
                 "avatar.fgn: member '0': a package of kind avatar has no members");
  expect_refused("render P/body.fgn#0 -o x.png", 1, "kind body has no members");
  expect_refused("render P/nobody.fgn#0 -o x.png", 1, "nobody.fgn");
  expect_refused("selftest P/people.fgn#0", 1,
                 "golden frame: the package has nothing to compare with");
  expect_refused("render P/people.fgn#0 --precision q8 -o x.png", 1,
                 "people.fgn#0: avatar 'ada': its network is there in f32 alone");
  expect_refused("render P/avatar.fgn --motion P/people.fgn -o x.png", 1,
                 "of kind population, not motion");
}

TEST_F(Cli, AFileNameMayHaveAHash) {
  folder_.write("who#0", packages_->read("avatar.fgn"));
  EXPECT_EQ(run("render 'who#0' --body P/body.fgn --size 32x32 -o x.png").exit_code, 0);
}

TEST_F(Cli, OpaqueBackgroundGivesRgb) {
  ASSERT_EQ(run("render P/avatar.fgn --size 40x40 --background '#336699' -o x.png").exit_code, 0);
  const ImageU8 image = png("x.png");
  ASSERT_EQ(image.channels, 3u);
  EXPECT_EQ(image.at(0, 0)[0], 0x33);
  EXPECT_EQ(image.at(0, 0)[1], 0x66);
  EXPECT_EQ(image.at(0, 0)[2], 0x99);
}

TEST_F(Cli, ThreadsDoNotChangePixels) {
  ASSERT_EQ(
      run("render P/avatar.fgn --motion P/motion.fgn --frames 5 --size 64x64 --threads 1 -o a.pfm")
          .exit_code,
      0);
  ASSERT_EQ(
      run("render P/avatar.fgn --motion P/motion.fgn --frames 5 --size 64x64 --threads 3 -o b.pfm")
          .exit_code,
      0);
  EXPECT_EQ(folder_.read("a.pfm"), folder_.read("b.pfm"));
}

TEST_F(Cli, AnInstructionSetIsNamedByOptionOrEnvironment) {
  const ProgramRun named = run("render P/avatar.fgn --isa baseline --json -o a.png");
  ASSERT_EQ(named.exit_code, 0) << named.err;
  EXPECT_NE(named.out.find("\"isa\": \"baseline\""), std::string::npos) << named.out;
  ASSERT_EQ(run("render P/avatar.fgn -o b.png").exit_code, 0);
  EXPECT_EQ(folder_.read("a.png"), folder_.read("b.png")) << "the same pixels with each";
  ASSERT_EQ(
      run("render P/avatar.fgn -o c.png", {.environment = "FIGURINE_ISA=baseline "}).exit_code, 0);
  const ProgramRun refused =
      run("render P/avatar.fgn -o d.png", {.environment = "FIGURINE_ISA=mmx "});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find("FIGURINE_ISA: isa 'mmx'"), std::string::npos) << refused.err;
  EXPECT_FALSE(folder_.has("d.png"));
}

TEST_F(Cli, PngIsTheRoundedPfm) {
  ASSERT_EQ(run("render P/avatar.fgn --size 64x64 -o x.pfm").exit_code, 0);
  ASSERT_EQ(run("render P/avatar.fgn --size 64x64 -o x.png").exit_code, 0);
  const ImageF32 exact = pfm("x.pfm");
  const ImageU8 rounded = png("x.png");
  ASSERT_EQ(exact.channels, 4u);
  ASSERT_EQ(exact.pixels.size(), rounded.pixels.size());
  for (size_t i = 0; i < exact.pixels.size(); ++i) {
    EXPECT_NEAR(255 * std::clamp(exact.pixels[i], 0.0f, 1.0f), rounded.pixels[i], 0.5001) << i;
  }
}

TEST_F(Cli, NumbersTheFramesOfASequence) {
  ASSERT_EQ(
      run("render P/avatar.fgn --motion P/motion.fgn --frames 2:9:3 --size 32x32 -o f_%03d.png")
          .exit_code,
      0);
  EXPECT_EQ(folder_.names(), (std::vector<std::string>{"f_002.png", "f_005.png", "f_008.png"}));
  EXPECT_NE(folder_.read("f_002.png"), folder_.read("f_008.png"));
}

TEST_F(Cli, WritesVideo) {
  ASSERT_EQ(run("render P/avatar.fgn --motion P/motion.fgn --frames 0:12:2 --size 33x20 -o x.y4m")
                .exit_code,
            0);
  const std::string video = folder_.read("x.y4m"),
                    header = "YUV4MPEG2 W33 H20 F15:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
  EXPECT_TRUE(video.starts_with(header)) << video.substr(0, 80);
  EXPECT_EQ(video.size(), header.size() + 6 * (6 + 33 * 20 + 2 * 17 * 10));
}

TEST_F(Cli, Mp4NeedsFfmpegAndSaysSo) {
  expect_refused("render P/avatar.fgn --motion P/motion.fgn --size 32x32 -o x.mp4", 1, "ffmpeg",
                 {.environment = "PATH=/nowhere"});
}

TEST_F(Cli, MakesAContactSheet) {
  ASSERT_EQ(run("render P/avatar.fgn --motion P/motion.fgn --size 48x32 --contact-sheet s.png "
                "--columns 3 --tiles 6 --sheet-shrink 2")
                .exit_code,
            0);
  const ImageU8 sheet = png("s.png");
  EXPECT_EQ(sheet.width_px, 3u * 24);
  EXPECT_EQ(sheet.height_px, 2u * 16);
  EXPECT_EQ(folder_.names(), std::vector<std::string>{"s.png"});
}

TEST_F(Cli, TheCameraThatJsonPrintsCanBeGivenBack) {
  const ProgramRun orbit =
      run("render P/avatar.fgn --size 64x48 --camera orbit:30,10,3,40 --near 0.1 --json -o a.pfm");
  ASSERT_EQ(orbit.exit_code, 0) << orbit.err;
  folder_.write("c.json", Json::parse(orbit.out)["camera"].dump());
  ASSERT_EQ(run("render P/avatar.fgn --camera c.json -o b.pfm").exit_code, 0);
  EXPECT_EQ(folder_.read("a.pfm"), folder_.read("b.pfm"));
  // Half the size is the same picture, coarser.
  ASSERT_EQ(run("render P/avatar.fgn --camera c.json --size 32x24 -o c.pfm").exit_code, 0);
  EXPECT_EQ(pfm("c.pfm").width_px, 32u);
}

TEST_F(Cli, FramingIsRefusedWhereItCannotBe) {
  expect_refused("render P/avatar.fgn --framing bust -o x.png", 1,
                 "framing: body 'jointed cylinder' has no joint called head");
  EXPECT_EQ(run("render P/avatar.fgn --framing feet -o x.png").exit_code, 2);
  EXPECT_EQ(run("render P/avatar.fgn --framing body --size 64x64 -o x.png").exit_code, 0);
}

TEST_F(Cli, SeveralAvatarsStandSideBySide) {
  ASSERT_EQ(run("render P/avatar.fgn --size 120x60 -o one.png").exit_code, 0);
  ASSERT_EQ(run("render P/avatar.fgn P/avatar.fgn --spacing 1.5 --camera orbit:0,0,6 --size 120x60 "
                "-o two.png")
                .exit_code,
            0);
  const ImageU8 two = png("two.png");
  size_t left = 0, middle = 0, right = 0;
  for (uint32_t y = 0; y < two.height_px; ++y) {
    for (uint32_t x = 0; x < two.width_px; ++x) {
      if (two.at(x, y)[3] < 128) continue;
      ++(x < 55 ? left : x < 65 ? middle : right);
    }
  }
  EXPECT_GT(left, 20u);
  EXPECT_GT(right, 20u);
  EXPECT_EQ(middle, 0u);
}

TEST_F(Cli, FollowingKeepsAWalkerInTheMiddle) {
  const auto mean_x = [&](const std::string& name) {
    const ImageU8 image = png(name);
    double sum = 0, weight = 0;
    for (uint32_t y = 0; y < image.height_px; ++y) {
      for (uint32_t x = 0; x < image.width_px; ++x)
        sum += x * image.at(x, y)[3], weight += image.at(x, y)[3];
    }
    EXPECT_GT(weight, 0);
    return sum / weight;
  };
  // The motion walks 1.1 m along x in its 12 frames.
  ASSERT_EQ(run("render P/avatar.fgn --motion P/motion.fgn --frames :  --camera orbit:0,0,5 --size "
                "64x64 -o f%02d.png")
                .exit_code,
            0);
  EXPECT_NEAR(mean_x("f00.png"), mean_x("f11.png"), 8);
  ASSERT_EQ(run("render P/avatar.fgn --motion P/motion.fgn --frames : --follow off --camera "
                "orbit:0,0,5 --size 64x64 -o s%02d.png")
                .exit_code,
            0);
  EXPECT_GT(mean_x("s11.png") - mean_x("s00.png"), 12);
}

TEST_F(Cli, ExportedGaussiansGiveTheSamePicture) {
  folder_.write(
      "c.json",
      R"({"width": 128, "height": 128, "intrinsics": [[170, 0, 64], [0, 170, 64], [0, 0, 1]],
          "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, -1, 3]]})");
  ASSERT_EQ(run("render P/avatar.fgn --motion P/motion.fgn --frames 3 --camera c.json -o a.pfm")
                .exit_code,
            0);
  ASSERT_EQ(run("export P/avatar.fgn --motion P/motion.fgn --frame 3 -o x.ply").exit_code, 0);
  ASSERT_EQ(run("splat x.ply --camera c.json -o b.pfm").exit_code, 0);
  samples::ErrorSum error;
  samples::add_foreground_error(pfm("a.pfm"), pfm("b.pfm"), error);
  std::printf("export_roundtrip_db %.2f over %llu values, largest difference %.3g\n",
              error.psnr_db(), static_cast<unsigned long long>(error.values / 3), error.largest);
  EXPECT_GT(error.values, 1000u);
  EXPECT_GE(error.psnr_db(), 80);
}

// Smallest extents are in the file's Gaussians; that they are antialiased, in its comments.
TEST_F(Cli, ExportedGaussiansWithFiltersGiveTheSamePicture) {
  folder_.write("c.json",
                R"({"width": 48, "height": 48, "intrinsics": [[60, 0, 24], [0, 60, 24], [0, 0, 1]],
          "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, -1, 3]]})");
  ASSERT_EQ(run("render P/filtered.fgn --camera c.json -o a.pfm").exit_code, 0);
  ASSERT_EQ(run("render P/avatar.fgn --camera c.json -o plain.pfm").exit_code, 0);
  const ProgramRun exported = run("export P/filtered.fgn --json -o x.ply");
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_EQ(Json::parse(exported.out)["antialiased"], true);
  EXPECT_NE(folder_.read("x.ply").find("\ncomment antialiased: "), std::string::npos);
  ASSERT_EQ(run("splat x.ply --camera c.json -o b.pfm").exit_code, 0);
  ASSERT_EQ(run("splat x.ply --camera c.json --no-antialiased -o without.pfm").exit_code, 0);
  samples::ErrorSum with, without, plain;
  samples::add_foreground_error(pfm("a.pfm"), pfm("b.pfm"), with);
  samples::add_foreground_error(pfm("a.pfm"), pfm("without.pfm"), without);
  samples::add_foreground_error(pfm("a.pfm"), pfm("plain.pfm"), plain);
  std::printf("with %.2f dB, without antialiasing %.2f dB, without filters %.2f dB\n",
              with.psnr_db(), without.psnr_db(), plain.psnr_db());
  EXPECT_GT(with.values, 200u);
  EXPECT_GE(with.psnr_db(), 80);
  EXPECT_LT(without.psnr_db(), 60);
  EXPECT_LT(plain.psnr_db(), 60);
}

TEST_F(Cli, SplatsAScene) {
  const ProgramRun result = run("splat P/scene.ply --size 80x60 --json -o x.png");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(visible_pixels(png("x.png")), 0u);
  const Json json = Json::parse(result.out);
  EXPECT_EQ(json["command"], "splat");
  EXPECT_EQ(json["gaussians"], 50);
  EXPECT_EQ(json["left_out"], 0);
  EXPECT_EQ(json["sh_degree"], 1);
}

TEST_F(Cli, SplatCountsWhatItLeavesOut) {
  folder_.write("holes.ply", make_ply(standard_columns(0), 20, PlyEncoding::kLittle,
                                      [](size_t row, const std::string& name) {
                                        return name == "x" && row < 3 ? NAN
                                                                      : sample_value(row, name);
                                      }));
  const ProgramRun result = run("splat holes.ply --size 32x32 -o x.png");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.err.find("left out 3 (Gaussian 0: its position is not finite)"),
            std::string::npos)
      << result.err;
}

TEST_F(Cli, EveryUpAxisGivesTheSameSceneTurned) {
  const auto turned = [](char up, int sign) {
    return make_ply(
        standard_columns(0), 30, PlyEncoding::kLittle, [=](size_t row, const std::string& name) {
          const double x = sample_value(row, "x"), y = sample_value(row, "y"),
                       z = sample_value(row, "z");
          if (name.starts_with("rot_")) return name == "rot_0" ? 1.0 : 0.0;
          if (name.starts_with("scale_")) return -2.5;
          if (up == 'y' && sign > 0)
            return name == "x" ? x : name == "y" ? y : name == "z" ? z : sample_value(row, name);
          if (up == 'y')
            return name == "x" ? x : name == "y" ? -y : name == "z" ? -z : sample_value(row, name);
          return name == "x"   ? x
                 : name == "y" ? -sign * z
                 : name == "z" ? sign * y
                               : sample_value(row, name);
        });
  };
  folder_.write("0.ply", turned('y', 1));
  ASSERT_EQ(run("splat 0.ply --up=+y --size 48x48 -o 0.pfm").exit_code, 0);
  const std::pair<std::string, std::string> cases[] = {
      {"-y", turned('y', -1)}, {"+z", turned('z', 1)}, {"-z", turned('z', -1)}};
  for (const auto& [up, text] : cases) {
    folder_.write("1.ply", text);
    ASSERT_EQ(run("splat 1.ply --up=" + up + " --size 48x48 -o 1.pfm").exit_code, 0);
    samples::ErrorSum error;
    samples::add_foreground_error(pfm("0.pfm"), pfm("1.pfm"), error);
    EXPECT_GT(error.values, 100u);
    EXPECT_GE(error.psnr_db(), 90) << up;
  }
}

TEST_F(Cli, BenchReportsEveryStage) {
  const ProgramRun result =
      run("bench P/avatar.fgn --motion P/motion.fgn --frames 10 --threads 2 --json b.json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("network"), std::string::npos);
  const Json json = Json::parse(folder_.read("b.json"));
  ASSERT_EQ(json["runs"].size(), 2u);
  EXPECT_EQ(json["runs"][0]["threads"], 1);
  EXPECT_EQ(json["runs"][1]["threads"], 2);
  for (const Json& lane : json["runs"]) {
    EXPECT_EQ(lane["stages_ms"].size(), 10u);
    const Json& total = lane["stages_ms"]["total"];
    EXPECT_GT(total["median"], 0.0);
    EXPECT_GE(total["p90"], total["median"]);
    EXPECT_GE(total["p99"], total["p90"]);
    // The 99th of 100 is the longest of ten.
    EXPECT_EQ(lane["missed_60hz"] > 0, total["p99"] > 1000.0 / 60);
    EXPECT_GT(lane["work"]["macs"], 0);
    EXPECT_GT(lane["work"]["blends"], 0);
    if (!lane["allocations_per_frame"].is_null()) {
      EXPECT_EQ(lane["allocations_per_frame"], 0.0);
    }
  }
  EXPECT_GT(json["peak_memory_bytes"], 0);
  EXPECT_GT(json["first_frame_ms"]["total"], 0.0);
}

TEST_F(Cli, BenchTakesSeveralFigures) {
  const auto bench = [&](const std::string& arguments) {
    const ProgramRun result = run("bench " + arguments + " --frames 3 --threads 1 --json -");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? Json::parse(result.out) : Json();
  };
  const Json one = bench("P/both.fgn --size 64x64"),
             three = bench("P/both.fgn P/both.fgn P/fixed.fgn --size 64x64");
  ASSERT_EQ(three["runs"].size(), 1u) << "what all of them hold";
  EXPECT_EQ(three["runs"][0]["precision"], "q8");
  EXPECT_EQ(three["runs"][0]["work"]["networks"], 3.0);
  EXPECT_EQ(three["avatars"].size(), 3u);
  EXPECT_GT(three["avatar_bytes"], one["avatar_bytes"]);
  EXPECT_EQ(three["body_bytes"], one["body_bytes"]) << "they share one";
  const Json mixed = bench("P/avatar.fgn P/fixed.fgn --size 64x64");
  ASSERT_EQ(mixed["runs"].size(), 1u);
  EXPECT_EQ(mixed["runs"][0]["precision"], "mixed");
}

TEST_F(Cli, BenchTakesASceneOfGaussians) {
  folder_.write("scene.ply", make_ply(standard_columns(1), 30, PlyEncoding::kLittle, sample_value));
  const ProgramRun result = run("bench scene.ply --size 64x48 --frames 4 --threads 2 --json -");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json json = Json::parse(result.out);
  EXPECT_EQ(json["scene"], "scene.ply");
  EXPECT_TRUE(json["avatars"].empty());
  EXPECT_EQ(json["size"], Json({64, 48}));
  ASSERT_EQ(json["runs"].size(), 2u);
  for (const Json& lane : json["runs"]) {
    EXPECT_TRUE(lane["precision"].is_null());
    EXPECT_EQ(lane["work"]["gaussians"], 30);
    EXPECT_GT(lane["work"]["blends"], 0);
    EXPECT_EQ(lane["work"]["macs"], 0);
  }
  EXPECT_NE(run("bench scene.ply --size 64x48 --frames 2").out.find("from all around"),
            std::string::npos);
  EXPECT_EQ(run("bench scene.ply P/both.fgn").exit_code, 1);
  EXPECT_EQ(run("bench scene.ply --motion P/motion.fgn").exit_code, 1);
  EXPECT_EQ(run("bench P/both.fgn --framing feet").exit_code, 2);
}

TEST_F(Cli, BenchMeasuresEveryPrecisionThatThePackageHolds) {
  const auto ways = [&](const std::string& arguments) {
    const ProgramRun result = run("bench " + arguments + " --frames 4 --threads 2 --json -");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    std::vector<std::string> list;
    if (result.exit_code != 0) return list;
    const Json json = Json::parse(result.out);
    for (const Json& lane : json["runs"]) {
      list.push_back(lane["precision"].get<std::string>() + " " +
                     std::to_string(lane["threads"].get<int>()));
      if (!lane["allocations_per_frame"].is_null()) {
        EXPECT_EQ(lane["allocations_per_frame"], 0.0);
      }
    }
    return list;
  };
  EXPECT_EQ(ways("P/both.fgn"), (std::vector<std::string>{"q8 1", "q8 2", "f32 1", "f32 2"}));
  EXPECT_EQ(ways("P/fixed.fgn"), (std::vector<std::string>{"q8 1", "q8 2"}));
  EXPECT_EQ(ways("P/both.fgn --precision f32"), (std::vector<std::string>{"f32 1", "f32 2"}));
}

TEST_F(Cli, ReportHasADialOfPrecisionsWhereThereAreTwo) {
  const ProgramRun result = run("report P/both.fgn --motion P/motion.fgn --frames 2 --json -o r");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json json = Json::parse(result.out);
  ASSERT_EQ(json["dials"].size(), 6u);
  const Json& averted = json["dials"][2];
  EXPECT_EQ(averted["name"], "averted texels");
  EXPECT_TRUE(averted["settings"].back()["psnr_db"].is_null()) << "nothing left out";
  EXPECT_FALSE(averted["settings"].front()["psnr_db"].is_null());
  const Json& tiers = json["dials"][1]["settings"];
  EXPECT_EQ(tiers[0]["label"], "fast");
  EXPECT_GT(tiers[0]["psnr_db"], 40);
  EXPECT_TRUE(tiers[1]["psnr_db"].is_null()) << "the exact blend is the reference";
  const Json& settings = json["dials"][5]["settings"];
  ASSERT_EQ(settings.size(), 2u);
  EXPECT_EQ(settings[0]["label"], "q8");
  EXPECT_GT(settings[0]["psnr_db"], 20);
  EXPECT_EQ(settings[1]["label"], "f32");
  EXPECT_TRUE(settings[1]["psnr_db"].is_null()) << "the reference itself";
  EXPECT_NE(folder_.read("r/report.html").find("Precision"), std::string::npos);
  EXPECT_EQ(json["machine"]["precision"], "q8");
  ASSERT_EQ(run("report P/both.fgn --precision q8 --frames 1 -o r").exit_code, 0);
  EXPECT_EQ(Json::parse(folder_.read("r/report.json"))["dials"].size(), 5u);
}

TEST_F(Cli, ReportHasDialsOfExactOmissionsAndOfTheNetworksInterval) {
  const ProgramRun result = run("report P/fixed.fgn --motion P/motion.fgn --frames 9 --json -o r");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json json = Json::parse(result.out);
  const Json& omissions = json["dials"][3];
  ASSERT_EQ(omissions["name"], "exact omissions");
  for (const Json& setting : omissions["settings"])
    EXPECT_TRUE(setting["psnr_db"].is_null()) << setting;
  EXPECT_GT(omissions["settings"].front()["work"]["pairs"],
            omissions["settings"].back()["work"]["pairs"]);
  const Json& intervals = json["dials"][4];
  ASSERT_EQ(intervals["name"], "network interval");
  ASSERT_EQ(intervals["settings"].size(), 4u);
  double before_db = 0;
  for (const Json& setting : intervals["settings"]) {  // one of 8, 4, 2; every pose
    const double interval = setting["value"];
    if (interval == 1) {
      EXPECT_TRUE(setting["psnr_db"].is_null()) << setting;
      continue;
    }
    EXPECT_GT(setting["psnr_db"], before_db) << setting;
    before_db = setting["psnr_db"];
    const double every = intervals["settings"].back()["work"]["macs"];
    EXPECT_NEAR(setting["work"]["macs"], every / interval, 1) << setting;
  }
}

TEST_F(Cli, EveryCommandTakesAPrecision) {
  const auto precision = [&](const std::string& arguments) {
    const ProgramRun result = run("render " + arguments + " --size 32x32 --json -o x.png");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0
               ? Json::parse(result.out)["machine"]["precision"].get<std::string>()
               : "";
  };
  EXPECT_EQ(precision("P/avatar.fgn"), "f32");
  EXPECT_EQ(precision("P/fixed.fgn"), "q8");
  EXPECT_EQ(precision("P/both.fgn"), "q8");
  EXPECT_EQ(precision("P/both.fgn --precision f32"), "f32");
  EXPECT_EQ(precision("P/avatar.fgn P/fixed.fgn"), "mixed");
  ASSERT_EQ(run("export P/both.fgn -o q8.ply").exit_code, 0);
  ASSERT_EQ(run("export P/both.fgn --precision f32 -o f32.ply").exit_code, 0);
  EXPECT_NE(folder_.read("q8.ply"), folder_.read("f32.ply"));
}

TEST_F(Cli, ReportPlotsTheAlphaCut) {
  const ProgramRun result = run("report P/avatar.fgn --motion P/motion.fgn --frames 3 -o r");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json json = Json::parse(folder_.read("r/report.json"));
  const Json& settings = json["dials"][0]["settings"];
  ASSERT_GE(settings.size(), 5u);
  double psnr = 0, blends = 0;
  int defaults = 0;
  for (const Json& setting : settings) {  // from coarse to fine: less error, more work
    EXPECT_GT(setting["psnr_db"].get<double>(), psnr);
    EXPECT_GE(setting["work"]["blends"].get<double>(), blends);
    psnr = setting["psnr_db"];
    blends = setting["work"]["blends"];
    defaults += setting["default"].get<bool>() ? 1 : 0;
  }
  EXPECT_EQ(defaults, 1);
  const std::string html = folder_.read("r/report.html");
  EXPECT_NE(html.find("<svg"), std::string::npos);
  EXPECT_EQ(html.find("http"), std::string::npos) << "the page must not reach for the network";
  EXPECT_EQ(html.find("<script"), std::string::npos);
}

// The golden picture is this renderer's own here; what is tested is the comparison. Trainer against
// device: tests/parity.
TEST_F(Cli, SelftestTellsTheRightPictureFromWrongOnes) {
  std::filesystem::copy(packages_->path("body.fgn"), folder_.path("body.fgn"));
  const SyntheticAvatar avatar = make_test_avatar(make_test_body());
  const std::array<float, 3> grey = avatar.package->avatar().golden.background;
  folder_.write("camera.json", samples::camera_json(avatar.package->avatar().golden.camera).dump());
  const std::string background =
      std::to_string(grey[0]) + "," + std::to_string(grey[1]) + "," + std::to_string(grey[2]);
  ASSERT_EQ(
      run("render P/avatar.fgn --camera camera.json --background " + background + " -o golden.png")
          .exit_code,
      0);
  write_golden_avatar(folder_, "right.fgn", folder_.read("golden.png"));
  const ProgramRun right = run("selftest right.fgn --json");
  EXPECT_EQ(right.exit_code, 0) << right.err;
  EXPECT_TRUE(Json::parse(right.out)["passed"].get<bool>());
  EXPECT_TRUE(Json::parse(right.out)["psnr_db"].is_null()) << "equal to the bit";
  EXPECT_GT(Json::parse(right.out)["foreground_pixels"], 20);

  ImageU8 picture = png("golden.png");
  const auto expect_failed = [&](const ImageU8& wrong, const char* what) {
    const std::vector<std::byte> bytes = *ports::encode_png(wrong);
    write_golden_avatar(folder_, "wrong.fgn",
                        std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    const ProgramRun result = run("selftest wrong.fgn --json");
    EXPECT_EQ(result.exit_code, 1) << what;
    EXPECT_EQ(result.error_lines(), 1u) << what;
    EXPECT_FALSE(Json::parse(result.out)["passed"].get<bool>()) << what;
  };
  ImageU8 brighter = picture;
  for (uint8_t& value : brighter.pixels)
    value = static_cast<uint8_t>(std::min(255, value + 2));  // 42 dB
  expect_failed(brighter, "brighter by two levels");
  ImageU8 moved = picture;
  std::copy(picture.pixels.begin(), picture.pixels.end() - 3, moved.pixels.begin() + 3);
  expect_failed(moved, "moved by a pixel");

  write_golden_avatar(folder_, "none.fgn", "");
  EXPECT_NE(run("selftest none.fgn").err.find("golden frame"), std::string::npos);
}

TEST_F(Cli, SelftestHoldsTheFrameInFixedPointToItsHash) {
  std::filesystem::copy(packages_->path("body.fgn"), folder_.path("body.fgn"));
  write_golden_avatar(folder_, "wrong.fgn", "", Held::kFixedPoint, {1, 0x2000000000000000u});
  const ProgramRun wrong = run("selftest wrong.fgn --json");
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_EQ(wrong.error_lines(), 1u) << wrong.err;
  const Json said = Json::parse(wrong.out);
  EXPECT_FALSE(said["passed"].get<bool>());
  const std::string here = said["fixed_point"]["hash"], there = said["fixed_point"]["golden_hash"];
  EXPECT_EQ(there, "20000000000000000000000000000001");
  for (const std::string& words : {here, there, std::string("a library"), std::string("XNNPACK")}) {
    EXPECT_NE(wrong.err.find(words), std::string::npos) << wrong.err;
  }

  const std::array<uint64_t, 2> hash = {std::stoull(here.substr(16), nullptr, 16),
                                        std::stoull(here.substr(0, 16), nullptr, 16)};
  write_golden_avatar(folder_, "right.fgn", "", Held::kFixedPoint, hash);
  for (const char* threads : {"1", "2"}) {
    const ProgramRun right = run(std::string("selftest right.fgn --json --threads ") + threads);
    EXPECT_EQ(right.exit_code, 0) << right.err;
    EXPECT_EQ(Json::parse(right.out)["machine"]["precision"], "q8");
    EXPECT_FALSE(Json::parse(right.out).contains("psnr_db")) << "nothing was compared in float";
  }

  // Both precisions: each has to agree.
  ASSERT_EQ(run("render P/both.fgn --precision f32 --size 64x64 --background 0,0,0 -o black.png")
                .exit_code,
            0);
  write_golden_avatar(folder_, "half.fgn", folder_.read("black.png"), Held::kBoth, hash);
  const ProgramRun half = run("selftest half.fgn --json");
  EXPECT_EQ(half.exit_code, 1);
  EXPECT_TRUE(Json::parse(half.out)["fixed_point"]["passed"].get<bool>());
  EXPECT_FALSE(Json::parse(half.out)["passed"].get<bool>());
  EXPECT_EQ(run("selftest half.fgn --precision q8").exit_code, 0);
  EXPECT_EQ(run("selftest half.fgn --precision f32").exit_code, 1);
}

TEST_F(Cli, RenderJsonHasWhatTheDemoNeeds) {
  const ProgramRun result =
      run("render P/avatar.fgn --motion P/motion.fgn --frames 0:4 --size 32x32 --json -o x.y4m");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json json = Json::parse(result.out);
  EXPECT_EQ(json["frames"], 4);
  EXPECT_GT(json["frames_per_second"], 0.0);
  for (const char* stage : {"total", "maps", "network", "blend"})
    EXPECT_TRUE(json["stages_ms"].contains(stage)) << stage;
}

TEST_F(Cli, BodiesAreFoundByContentHash) {
  // By --body; in FIGURINE_PATH; in a folder beside the avatar's; beside the avatar, under any
  // name.
  TestFolder apart;
  const std::string own = apart.path("own/"), bodies = apart.path("bodies/");
  std::filesystem::create_directories(own);
  std::filesystem::create_directories(bodies);
  std::filesystem::copy(packages_->path("avatar.fgn"), own + "avatar.fgn");
  const std::string render = "render '" + own + "avatar.fgn' --size 16x16 -o x.png";
  ProgramRun result = run(render);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("body: needs "), std::string::npos) << result.err;
  EXPECT_EQ(run(render + " --body P/body.fgn").exit_code, 0);
  EXPECT_EQ(run(render, {.environment = "FIGURINE_PATH=/nowhere:" + packages_->path()}).exit_code,
            0);
  std::filesystem::copy(packages_->path("other_body.fgn"), bodies + "anything.fgn");
  result = run(render);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("found others: " + bodies + "anything.fgn is "), std::string::npos)
      << result.err;
  std::filesystem::copy(packages_->path("body.fgn"), bodies + "something.fgn");
  EXPECT_EQ(run(render).exit_code, 0);
  std::filesystem::remove_all(bodies);
  EXPECT_EQ(run(render).exit_code, 1);
  std::filesystem::copy(packages_->path("body.fgn"), own + "anything.fgn");
  EXPECT_EQ(run(render).exit_code, 0);
}

TEST_F(Cli, AWrongBodyIsNamedWithBothHashes) {
  const ProgramRun result =
      run("render P/avatar.fgn --body P/other_body.fgn --size 16x16 -o x.png");
  EXPECT_EQ(result.exit_code, 1);
  size_t hashes = 0, digits = 0;
  for (const char c : result.err + " ") {
    digits = std::isxdigit(static_cast<unsigned char>(c)) ? digits + 1 : 0;
    hashes += digits == 32;
  }
  EXPECT_EQ(hashes, 2u) << result.err;
  EXPECT_TRUE(folder_.names().empty());
}

TEST_F(Cli, BadInputGetsOneLineAndNoFile) {
  expect_refused("render P/missing.fgn -o x.png", 1, "missing.fgn");
  expect_refused("render P/noise.fgn -o x.png", 1, "noise.fgn");
  expect_refused("render P -o x.png", 1, "P");
  expect_refused("render P/motion.fgn -o x.png", 1,
                 "motion.fgn: kind: is a package of kind motion, not avatar");
  expect_refused("render P/avatar.fgn --motion P/body.fgn -o x.png", 1, "not motion");
  expect_refused("render P/avatar.fgn --body P/avatar.fgn -o x.png", 1, "not body");
  expect_refused("render P/avatar.fgn --motion P/motion.fgn --frames 5:13 -o x_%d.png", 1,
                 "the motion has 12 frames");
  expect_refused("render P/avatar.fgn --frames 1 -o x.png", 1,
                 "without --motion there is one frame");
  expect_refused("render P/avatar.fgn --motion P/motion.fgn --frames 0:5 -o x.png", 1,
                 "x_%04d.png");
  expect_refused("render P/avatar.fgn --camera none.json -o x.png", 1, "none.json");
  expect_refused("render P/avatar.fgn --camera orbit:0,95,3 -o x.png", 1, "elevation");
  expect_refused("render P/avatar.fgn -o x.tga", 1, "x.tga");
  expect_refused("render P/avatar.fgn -o /dev/video0", 1, "figurine live");
  expect_refused("render P/avatar.fgn -o no/such/folder/x.png", 1, "no/such/folder/x.png");
  expect_refused("render P/avatar.fgn --background alpha -o x.y4m", 1, "alpha");
  expect_refused("render P/avatar.fgn", 1, "nothing to write");
  expect_refused("render P/avatar.fgn --size 100000x2 -o x.png", 1, "size");
  expect_refused("render P/avatar.fgn --precision q8 -o x.png", 1,
                 "figurine-train pack --precision q8");
  expect_refused("render P/fixed.fgn --precision f32 -o x.png", 1, "in q8 alone, not in f32");
  expect_refused("bench P/fixed.fgn --precision f32", 1, "in q8 alone, not in f32");
  expect_refused("selftest P/fixed.fgn --precision f32", 1, "nothing to compare with");
  expect_refused("render P/avatar.fgn --precision f16 -o x.png", 1, "unsupported in this build");
  expect_refused("render P/avatar.fgn --isa mmx -o x.png", 1, "unsupported in this build");
  expect_refused("render P/avatar.fgn P/avatar.fgn --place 0,0 -o x.png", 1, "place");
  expect_refused("splat P/missing.ply -o x.png", 1, "missing.ply");
  expect_refused("splat P/avatar.fgn -o x.png", 1, "does not start with 'ply'");
  expect_refused("splat P/scene.ply -o x.y4m", 1, "x.y4m");
  expect_refused("export P/avatar.fgn -o x.splat", 1, ".ply");
  expect_refused("export P/avatar.fgn --frame 3 -o x.ply", 1, "frames");
  expect_refused("bench P/body.fgn", 1, "not avatar");
  expect_refused("report P/avatar.fgn --size x -o r", 1, "size");
  expect_refused("selftest P/missing.fgn", 1, "missing.fgn");
}

TEST_F(Cli, AMalformedCommandLineIsUsage) {
  expect_refused("", 2, "which command? There is sample, render");
  expect_refused("paint", 2, "there is no command 'paint'");
  expect_refused("render", 2, "avatars");
  expect_refused("render P/avatar.fgn --colour red -o x.png", 2, "--colour");
  expect_refused("render P/avatar.fgn --threads 0 -o x.png", 2, "--threads");
  expect_refused("render P/avatar.fgn --threads many -o x.png", 2, "--threads");
  expect_refused("render P/avatar.fgn --follow maybe -o x.png", 2, "--follow");
  expect_refused("splat P/scene.ply", 2, "--output");
  expect_refused("bench P/avatar.fgn --frames 0", 2, "--frames");
}

TEST_F(Cli, HelpAndVersionAreNoErrors) {
  for (const char* arguments :
       {"--help", "--version", "render --help", "splat --help", "report --help"}) {
    const ProgramRun result = run(arguments);
    EXPECT_EQ(result.exit_code, 0) << arguments;
    EXPECT_NE(result.out, "") << arguments;
    EXPECT_EQ(result.err, "") << arguments;
  }
}

// The system refuses to write past a limit, as a full disk does. XFSZ is the signal of the limit; a
// disk sends none.
TEST_F(Cli, AFullDiskLeavesNothing) {
  const RunOptions full{.before =
                            "trap '' XFSZ; ulimit -f 4;"};  // 4 KiB: less than any of these files
  expect_refused("render P/avatar.fgn --size 256x256 -o x.pfm", 1, "x.pfm", full);
  expect_refused("render P/avatar.fgn --motion P/motion.fgn --size 256x256 -o x.y4m", 1, "x.y4m",
                 full);
  expect_refused("render P/avatar.fgn --motion P/motion.fgn --size 256x256 -o x_%d.pfm", 1,
                 "x_0.pfm", full);
  expect_refused("export P/avatar.fgn -o x.ply", 1, "x.ply", full);
}

TEST_F(Cli, AnInterruptLeavesNothing) {
  for (const char* output : {"x.y4m", "x_%04d.png"}) {
    // Long enough to be interrupted: the same twelve frames at a size that takes seconds.
    const ProgramRun result =
        run("render P/avatar.fgn --motion P/motion.fgn --size 3000x3000 --threads 1 -o " +
                std::string(output),
            {.before = "timeout -s INT 0.7"});
    EXPECT_NE(result.exit_code, 0);
    EXPECT_NE(result.exit_code, 1);
    EXPECT_TRUE(folder_.names().empty()) << folder_.names().front();
  }
}

TEST_F(Cli, ExistingFilesAreReplacedOnlyByWholeOnes) {
  folder_.write("x.png", "old");
  EXPECT_EQ(run("render P/avatar.fgn --frames 99 --size 16x16 -o x.png").exit_code, 1);
  EXPECT_EQ(folder_.read("x.png"), "old");
  EXPECT_EQ(run("render P/avatar.fgn --size 16x16 -o x.png").exit_code, 0);
  EXPECT_EQ(png("x.png").width_px, 16u);
}

}  // namespace
}  // namespace figurine::tests::cli_test
