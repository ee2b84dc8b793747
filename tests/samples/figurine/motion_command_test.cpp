// figurine motion the way a user runs it: a clip becomes a motion that the package says all of, and
// a wrong one gets one line and no file.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "samples/program.h"

namespace figurine::tests::motion_command_test {
namespace {

const std::string kCases = FIGURINE_SOURCE_DIR "/tests/data/cases/";
const std::string kBody = " --body " FIGURINE_SOURCE_DIR "/samples/packages/body-64.fgn";

class MotionCommand : public testing::Test {
 protected:
  ProgramRun run(const std::string& arguments) {
    return run_figurine("motion " + arguments, {.folder = folder_.path()});
  }
  TestFolder folder_;
};

TEST_F(MotionCommand, AClipBecomesAMotionThatSaysWhereItIsFrom) {
  const ProgramRun made =
      run(kCases + "bvh-reference/in.bvh" + kBody + " --fps 24 --name steps --json -o steps.fgn");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(made.error_lines(), 1u) << made.err;
  EXPECT_NE(made.err.find("12 frames at 30 a second, up y, T-pose from the first frame"),
            std::string::npos)
      << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_EQ(json["command"], "motion");
  EXPECT_EQ(json["frames"], 9);
  EXPECT_EQ(json["source"], "in.bvh: supplied by the user");
  const auto file = ports::MappedFile::open(folder_.path("steps.fgn"));
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->bytes().size(), json["size_bytes"]);
  const auto package = Package::open(file->bytes(), "steps.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  EXPECT_EQ(package->motion().name, "steps");
  EXPECT_EQ(package->motion().frames_per_second, 24);
  EXPECT_EQ(package->provenance().sources,
            std::vector<std::string>{"in.bvh: supplied by the user"});
  EXPECT_EQ(package->provenance().settings[0].value, "motion in.bvh");
}

TEST_F(MotionCommand, OptionsReachTheReader) {
  folder_.write("map.json", R"({"left_knee": "LeftLeg"})");
  const ProgramRun made = run(kCases + "npz-no-rate/in.npz" + kBody +
                              " --source-fps 60 --up z --head-pitch -5 --source mine -o m.fgn");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.err.find("12 frames at 60 a second, up z, "), std::string::npos) << made.err;
  EXPECT_NE(made.err.find("head pitched by -5 degrees"), std::string::npos) << made.err;
  EXPECT_EQ(run(kCases + "bvh-reference/in.bvh" + kBody + " --map map.json -o n.fgn").exit_code, 0);
}

TEST_F(MotionCommand, BadInputGetsOneLineAndNoFile) {
  write_test_packages(folder_);
  folder_.write("strange.json", R"({"left_knea": "x"})");
  const std::string clip = kCases + "bvh-reference/in.bvh", out = " -o x.fgn";
  const std::vector<std::string> before = folder_.names();
  for (const auto& [arguments, reason] : std::vector<std::pair<std::string, std::string>>{
           {"none.bvh" + kBody + out, "none.bvh"},
           {clip + " --body body.fgn" + out, "body: joints: not the 55 of SMPL-X"},
           {clip + " --body motion.fgn" + out, "motion.fgn"},
           {"motion.fgn" + kBody + out, "motion.fgn: is a motion package already"},
           {clip + kBody + " --start 12" + out, "in.bvh: start 12: the clip has 12 frames"},
           {clip + kBody + " --in-place" + out, "--in-place: walks on the spot with --loop alone"},
           {clip + kBody + " --map strange.json" + out, "'left_knea' is no joint"},
           {clip + kBody + " --map none.json" + out, "--map: none.json"},
           {clip + kBody + " -o none/x.fgn", "none/x.fgn"}}) {
    const ProgramRun wrong = run(arguments);
    EXPECT_EQ(wrong.exit_code, 1) << arguments;
    EXPECT_EQ(wrong.error_lines(), 1u) << wrong.err;
    EXPECT_NE(wrong.err.find(reason), std::string::npos) << wrong.err;
    EXPECT_EQ(folder_.names(), before) << arguments;
  }
  for (const char* usage : {" --fps 0", " --fps x", " --up w", " --neutral second", " --map ''"})
    EXPECT_EQ(run(clip + kBody + usage + out).exit_code, 2) << usage;
}

}  // namespace
}  // namespace figurine::tests::motion_command_test
