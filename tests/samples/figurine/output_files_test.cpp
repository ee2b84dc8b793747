// What figurine render writes, by names, rates and turns.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "runtime/test_packages.h"
#include "samples/program.h"

namespace figurine::tests::output_files_test {
namespace {

class OutputFiles : public testing::Test {
 protected:
  OutputFiles() {
    write_test_packages(packages_);
    for (const char* name : {"avatar.fgn", "motion.fgn", "body.fgn"})
      folder_.write(name, packages_.read(name));
    before_ = folder_.names().size();
  }
  ProgramRun run(const std::string& arguments) {
    return run_figurine(arguments, {.folder = folder_.path()});
  }
  void render(const std::string& arguments) {
    const ProgramRun result =
        run("render avatar.fgn --motion motion.fgn --size 40x32 " + arguments);
    ASSERT_EQ(result.exit_code, 0) << arguments << ": " << result.err;
    said_ = result.err;
  }
  void expect_refused(const std::string& arguments, const std::string& reason) {
    const ProgramRun result =
        run("render avatar.fgn --motion motion.fgn --size 40x32 " + arguments);
    EXPECT_EQ(result.exit_code, 1) << arguments;
    EXPECT_EQ(result.error_lines(), 1u) << result.err;
    EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
    EXPECT_EQ(written(), 0u) << arguments;
  }
  size_t written() const { return folder_.names().size() - before_; }

  TestFolder folder_;
  std::string said_;

 private:
  TestFolder packages_;
  size_t before_ = 0;
};

TEST_F(OutputFiles, NumberedPicturesKeepTheFramesNumbers) {
  render("--frames 2:9:3 -o f_%03d.png");
  EXPECT_EQ(written(), 3u);
  for (const char* name : {"f_002.png", "f_005.png", "f_008.png"})
    EXPECT_FALSE(folder_.read(name).empty()) << name;
}

TEST_F(OutputFiles, AJpegHasABackgroundAndTheSamePicture) {
  render("--frames 3 --background 0.86,0.88,0.90 -o a.png -o b.JPG");
  render("--frames 3 -o c.jpeg");
  EXPECT_EQ(folder_.read("b.JPG"), folder_.read("c.jpeg")) << "the background that it has anyway";
  const std::string png = folder_.read("a.png"), jpeg = folder_.read("b.JPG");
  const ports::ImageU8 a = ports::decode_png(std::as_bytes(std::span(png)), "a").value();
  const ports::ImageU8 b = ports::decode_jpeg(std::as_bytes(std::span(jpeg)), "b").value();
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  double squares = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    squares += (a.pixels[i] - b.pixels[i]) * (a.pixels[i] - b.pixels[i]);
  EXPECT_GT(10 * std::log10(255.0 * 255 * a.pixels.size() / squares), 32);
}

TEST_F(OutputFiles, SeveralFilesAreWrittenAtOnce) {
  render("--frames 0:4 -o a.y4m -o b.webp -o c_%d.jpg --contact-sheet s.jpg");
  EXPECT_EQ(written(), 2u + 4 + 1);
  EXPECT_EQ(folder_.read("b.webp").substr(0, 4), "RIFF");
  EXPECT_EQ(folder_.read("b.webp").substr(8, 4), "WEBP");
  EXPECT_EQ(folder_.read("s.jpg").substr(0, 2), "\xff\xd8");
}

TEST_F(OutputFiles, NothingTakesAnothersPlace) {
  expect_refused("-o a.webp -o ./a.webp", "written twice");
  expect_refused("--frames 0:4 -o s_%d.png --contact-sheet s_2.png", "the contact sheet");
  expect_refused("--frames 0:4 -o a.webp --contact-sheet s.bmp", ".png or .jpg");
  expect_refused("--frames 0:4 --fps 60 -o a_%d.png", "frames repeat");
  expect_refused("--frames 0:4 -o a.y4m -o b_%d.pfm", "floats");
  expect_refused("--frames 0:4 -o a.avi", "a.avi");
  expect_refused("--frames 3 --background alpha -o x.jpg", "x.jpg: has no alpha");
}

// The test motion has 30 frames a second.
TEST_F(OutputFiles, ARateKeepsRealTimeInEveryContainer) {
  render("--frames 0:12 --fps 10 -o a.y4m -o b.webp -o c_%02d.png");
  EXPECT_NE(said_.find("one frame of 3"), std::string::npos) << said_;
  const std::string y4m = folder_.read("a.y4m");
  EXPECT_NE(y4m.find(" F10:1 "), std::string::npos);
  const size_t frame_bytes = 6 + 40 * 32 + 2 * 20 * 16;
  EXPECT_EQ((y4m.size() - y4m.find('\n') - 1) / frame_bytes, 4u);
  EXPECT_EQ(written(), 2u + 4);
  EXPECT_FALSE(folder_.read("c_09.png").empty());
}

TEST_F(OutputFiles, ATurntableGoesRoundAStillFigure) {
  render("--frames 5 --turntable 4 -o t_%d.png");
  ASSERT_EQ(written(), 4u);
  EXPECT_NE(folder_.read("t_0.png"), folder_.read("t_1.png"));
  render("--frames 5 --turntable 8 -o u_%d.png");
  EXPECT_EQ(folder_.read("t_1.png"), folder_.read("u_2.png")) << "a quarter of the way";
  folder_.write("c.json", nlohmann::json::parse(
                              run("render avatar.fgn --size 40x32 --json -o x.png").out)["camera"]
                              .dump());
  const ProgramRun result = run("render avatar.fgn --camera c.json --turntable 4 -o v_%d.png");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("turntable"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace figurine::tests::output_files_test
