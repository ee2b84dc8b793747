// A pose of one's own from the outside: a frame of a motion becomes a file that draws the same
// picture, and a wrong file gets one line and no picture.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "samples/program.h"

namespace figurine::tests::pose_command_test {
namespace {

using Json = nlohmann::json;

class PoseCommand : public testing::Test {
 protected:
  void SetUp() override { write_test_packages(folder_); }
  ProgramRun run(const std::string& arguments) {
    return run_figurine(arguments, {.folder = folder_.path()});
  }
  void expect_refused(const std::string& pose, const std::string& reason) {
    folder_.write("wrong.json", pose);
    const ProgramRun result = run("render avatar.fgn --pose wrong.json -o x.png");
    EXPECT_EQ(result.exit_code, 1) << pose;
    EXPECT_EQ(result.error_lines(), 1u) << result.err;
    EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("wrong.json"), std::string::npos) << result.err;
    EXPECT_FALSE(folder_.has("x.png"));
  }
  TestFolder folder_;
};

TEST_F(PoseCommand, AFrameAsAFileDrawsTheSamePicture) {
  ASSERT_EQ(run("pose --from motion.fgn --frame 7 -o pose.json").exit_code, 0);
  ASSERT_EQ(run("render avatar.fgn --pose pose.json --size 64x64 -o file.pfm").exit_code, 0);
  ASSERT_EQ(
      run("render avatar.fgn --motion motion.fgn --frames 7 --size 64x64 -o motion.pfm").exit_code,
      0);
  EXPECT_EQ(folder_.read("file.pfm"), folder_.read("motion.pfm"));
  ASSERT_EQ(run("export avatar.fgn --pose pose.json -o file.ply").exit_code, 0);
  ASSERT_EQ(run("export avatar.fgn --motion motion.fgn --frame 7 -o motion.ply").exit_code, 0);
  EXPECT_EQ(folder_.read("file.ply"), folder_.read("motion.ply"));
}

TEST_F(PoseCommand, StandardOutputHasTheSameBytes) {
  const ProgramRun printed = run("pose --from motion.fgn --frame 3");
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  const ProgramRun written = run("pose --from motion.fgn --frame 3 --json -o pose.json");
  ASSERT_EQ(written.exit_code, 0) << written.err;
  EXPECT_EQ(folder_.read("pose.json"), printed.out);
  EXPECT_EQ(Json::parse(written.out)["joints"], 4);
  EXPECT_EQ(Json::parse(printed.out)["joints"].size(), 4u);
}

TEST_F(PoseCommand, APoseOfOnesOwnTurnsWhatItNames) {
  folder_.write("rest.json", "{}");
  folder_.write("bent.json", R"({"joints": {"joint2": [0, 0, 0.7]}})");
  folder_.write("up.json", R"({"root_translation_m": [0, 0.3, 0]})");
  for (const char* name : {"rest", "bent", "up"}) {
    const std::string n(name);
    ASSERT_EQ(run("render avatar.fgn --pose " + n +
                  ".json --camera orbit:0,0,4 --follow off "
                  "--size 48x48 -o " +
                  n + ".pfm")
                  .exit_code,
              0);
  }
  EXPECT_NE(folder_.read("rest.pfm"), folder_.read("bent.pfm"));
  EXPECT_NE(folder_.read("bent.pfm"), folder_.read("up.pfm"));
  // One for each avatar.
  ASSERT_EQ(run("render avatar.fgn avatar.fgn --pose rest.json --pose bent.json --size 48x48 "
                "-o two.pfm")
                .exit_code,
            0);
  ASSERT_EQ(run("render avatar.fgn avatar.fgn --pose rest.json --size 48x48 -o same.pfm").exit_code,
            0);
  EXPECT_NE(folder_.read("two.pfm"), folder_.read("same.pfm"));
}

TEST_F(PoseCommand, SaysHowUnusualThePoseIs) {
  const ProgramRun rest =
      run("pose --from motion.fgn --frame 0 --avatar knowing.fgn --json -o pose.json");
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_NE(rest.err.find("motion.fgn: frame 0: at distance 0.0, 100 % of the training poses are "
                          "farther out"),
            std::string::npos)
      << rest.err;
  EXPECT_EQ(Json::parse(rest.out)["rarity"]["share_beyond"], 1);
  const ProgramRun bent =
      run("pose --from motion.fgn --frame 3 --avatar knowing.fgn --json -o pose.json");
  EXPECT_EQ(Json::parse(bent.out)["rarity"]["share_beyond"], 0);
  EXPECT_GT(Json::parse(bent.out)["rarity"]["distance"], 2);
  const ProgramRun silent = run("pose --from motion.fgn --avatar avatar.fgn -o none.json");
  EXPECT_EQ(silent.exit_code, 1);
  EXPECT_NE(silent.err.find("avatar.fgn: does not say which poses it knows"), std::string::npos)
      << silent.err;
  EXPECT_FALSE(folder_.has("none.json"));
}

TEST_F(PoseCommand, AWrongFileGetsOneLineAndNoPicture) {
  expect_refused(R"({"joints": {"joint22": [1, 0, 0, 0]}})", "nearest: joint2");
  expect_refused(R"({"joints": {"joint2": [0, 0, 0, 0]}})", "no length");
  expect_refused(R"({"joints": {"joint2": [0, 0]}})", "has 2 numbers");
  expect_refused("", "pose: ");
  expect_refused(folder_.read("motion.fgn"), "is a package, not JSON");
}

TEST_F(PoseCommand, AWrongQuestionGetsOneLine) {
  const auto refused = [&](const std::string& arguments, int code, const std::string& reason) {
    const ProgramRun result = run(arguments);
    EXPECT_EQ(result.exit_code, code) << arguments;
    EXPECT_EQ(result.error_lines(), 1u) << result.err;
    EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_FALSE(folder_.has("x.json"));
    EXPECT_FALSE(folder_.has("x.png"));
  };
  refused("pose --from motion.fgn --frame 12 -o x.json", 1, "the motion has 12 frames");
  refused("pose --from body.fgn -o x.json", 1, "not motion");
  refused("pose --from none.fgn -o x.json", 1, "none.fgn");
  refused("pose --from motion.fgn -o no/such/x.json", 1, "no/such/x.json");
  refused("pose --frame 2", 2, "--from");
  refused("pose --from motion.fgn --json", 2, "--output");
  refused("render avatar.fgn --pose none.json -o x.png", 1, "none.json");
  folder_.write("rest.json", "{}");
  refused("render avatar.fgn --pose rest.json --motion motion.fgn -o x.png", 1, "not both");
  refused("render avatar.fgn --pose rest.json --pose rest.json -o x.png", 1, "pose: give one");
  refused("render avatar.fgn --pose rest.json --frames 1 -o x.png", 1, "there is one frame");
}

}  // namespace
}  // namespace figurine::tests::pose_command_test
