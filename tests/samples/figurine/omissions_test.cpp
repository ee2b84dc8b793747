// What render may leave out, by the options that ask for it, and crowds, which need it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "runtime/test_packages.h"
#include "samples/program.h"

namespace figurine::tests::omissions_test {
namespace {

using Json = nlohmann::json;

class Omissions : public testing::Test {
 protected:
  Omissions() { write_test_packages(folder_); }
  ProgramRun run(const std::string& arguments) {
    return run_figurine(arguments, {.folder = folder_.path()});
  }

 private:
  TestFolder folder_;
};

TEST_F(Omissions, SmallFiguresMayKeepWhatTheirNetworkSaid) {
  const auto work = [&](const std::string& option) {
    const ProgramRun result =
        run("render avatar.fgn --motion motion.fgn --frames 0:4 --size "
            "64x64 --json -o x_%02d.png " +
            option);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json::parse(result.out);
  };
  EXPECT_EQ(work("")["work"]["networks"], 1.0);
  EXPECT_EQ(work("")["network_below_px"], 0.0);
  const Json kept = work("--network-below-px 100");
  EXPECT_EQ(kept["network_below_px"], 100.0);
  EXPECT_EQ(kept["work"]["networks"], 0.25);
  EXPECT_EQ(kept["work"]["stale_networks"], 0.75);
  EXPECT_EQ(work("--network-below-px 8")["work"]["networks"], 1.0);
  EXPECT_EQ(run("render avatar.fgn -o x.png --network-below-px -1").exit_code, 2);
}

TEST_F(Omissions, FiguresKeepToKnownPosesWhereThatIsAskedFor) {
  const auto work = [&](const std::string& avatar, const std::string& option) {
    const ProgramRun result = run("render " + avatar +
                                  " --motion motion.fgn --frames 0:4 --size 64x64 --json -o "
                                  "x_%02d.png " +
                                  option);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json::parse(result.out);
  };
  EXPECT_EQ(work("knowing.fgn", "")["keep_to_known"], false);
  EXPECT_EQ(work("knowing.fgn", "")["work"]["pulled_poses"], 0.0);
  EXPECT_EQ(work("knowing.fgn", "--keep-to-known")["keep_to_known"], true);
  // Frame 0 is the rest pose, which it knows.
  EXPECT_EQ(work("knowing.fgn", "--keep-to-known")["work"]["pulled_poses"], 0.75);
  EXPECT_EQ(work("avatar.fgn", "--keep-to-known")["work"]["pulled_poses"], 0.0);
}

TEST_F(Omissions, TheFastBlendIsAskedForByName) {
  const auto render = [&](const std::string& option) {
    const ProgramRun result = run("render avatar.fgn --size 64x64 --json -o x.png " + option);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json::parse(result.out);
  };
  EXPECT_EQ(render("")["fast_blend"], false);
  EXPECT_EQ(render("--fast-blend")["fast_blend"], true);
}

TEST_F(Omissions, WhatIsLeftOutIsAskedForByName) {
  const auto render = [&](const std::string& option) {
    const ProgramRun result =
        run("render avatar.fgn --motion motion.fgn --frames 0:6 --size 64x64 --fps 30 --json "
            "-o x_%02d.png " +
            option);
    EXPECT_EQ(result.exit_code, 0) << option << ": " << result.err;
    return Json::parse(result.out);
  };
  const Json plain = render("");
  EXPECT_EQ(plain["network_interval"], 1);
  EXPECT_EQ(plain["averted_above"], 1.0);
  const Json slow = render("--network-hz 10");
  EXPECT_EQ(slow["network_interval"], 3);
  EXPECT_NEAR(slow["work"]["networks"].get<double>(), 1.0 / 3, 1e-9);
  EXPECT_EQ(render("--network-hz 60")["network_interval"], 1);
  const Json facing = render("--averted-above 0");
  EXPECT_GT(facing["work"]["averted_texels"], 0.0);
  EXPECT_LT(facing["work"]["visible"], plain["work"]["visible"]);
  EXPECT_EQ(render("--sh-degree 0")["sh_degree"], 0);
  EXPECT_EQ(render("--keep missed-tiles --keep stopped")["work"]["blends"], plain["work"]["blends"])
      << "more is looked at, and the same drawn";
  EXPECT_EQ(run("render avatar.fgn -o x.png --keep nothing").exit_code, 2);
  EXPECT_EQ(run("render avatar.fgn -o x.png --averted-above 1.5").exit_code, 2);
}

TEST_F(Omissions, WhatIsLeftOutExactlyIsComputedWhereThatIsAskedFor) {
  const auto networks = [&](const std::string& option) {
    const ProgramRun result =
        run("render avatar.fgn avatar.fgn --place 0,0 --place 0,0 --size "
            "32x32 --json -o x.png " +
            option);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Json::parse(result.out)["work"]["networks"].get<double>();
  };
  EXPECT_EQ(networks(""), 0.0) << "the pose is the one that the picture was framed by";
  EXPECT_EQ(networks("--keep unchanged-networks"), 2.0);
}

TEST_F(Omissions, ACrowdIsManyOfEveryAvatar) {
  const auto render = [&](const std::string& option) {
    const ProgramRun result = run("render avatar.fgn --size 96x96 --json -o x.png " + option);
    EXPECT_EQ(result.exit_code, 0) << option << ": " << result.err;
    return Json::parse(result.out);
  };
  const Json one = render(""), crowd = render("--motion motion.fgn --crowd 9");
  EXPECT_EQ(crowd["work"]["gaussians"], 9 * one["work"]["gaussians"].get<int>());
  EXPECT_EQ(crowd["work"]["networks"], 9.0) << "each has a pose of its own";
  const Json coarse =
      render("--motion motion.fgn --crowd 4 --coarse avatar.fgn --coarse-below-px 96");
  EXPECT_EQ(coarse["work"]["coarse_avatars"], 4.0);
  const ProgramRun placed = run("render avatar.fgn --crowd 4 --place 0,0 -o x.png");
  EXPECT_EQ(placed.exit_code, 1);
  EXPECT_NE(placed.err.find("place: a crowd"), std::string::npos) << placed.err;
  const ProgramRun two =
      run("render avatar.fgn avatar.fgn avatar.fgn --coarse avatar.fgn "
          "--coarse avatar.fgn -o x.png");
  EXPECT_EQ(two.exit_code, 1);
  EXPECT_NE(two.err.find("coarse: give one for all"), std::string::npos) << two.err;
}

}  // namespace
}  // namespace figurine::tests::omissions_test
