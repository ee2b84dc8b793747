// figurine sample from end to end, on a sampler of random numbers for the test body: the same file
// for the same seed, what the file says of itself, the trace, and everything that must be refused
// without a file.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "formats/writer/sampler_writer.h"
#include "ports/host/files.h"
#include "runtime/sample/random_sampler.h"
#include "samples/program.h"

namespace figurine::sample_command_test {
namespace {

using tests::ProgramRun;
using tests::run_figurine;
using tests::TestFolder;

class SampleCommand : public testing::Test {
 protected:
  // golden: the hash that seed 0 is said to have.
  void write_sampler(const std::string& name, const std::array<uint64_t, 2>& golden = {0, 0}) {
    const tests::SyntheticBody body = tests::make_test_body();
    const tests::SyntheticAvatar avatar = tests::make_test_avatar(body);
    tests::RandomSampler random({.uv_size = 16, .channels = 4, .shape_count = 2});
    Sampler& sampler = random.view;
    const Avatar& like = avatar.package->avatar();
    sampler.name = "crowd";
    sampler.body_name = like.body_name, sampler.body_hash = like.body_hash;
    sampler.preset = like.preset;
    sampler.map_statistics = like.map_statistics, sampler.decoding = like.decoding;
    sampler.golden = like.golden;
    sampler.golden.png = {};
    sampler.steps = 6;
    if (golden != std::array<uint64_t, 2>{0, 0})
      sampler.golden_seeds.push_back({.seed = 0, .steps = 6, .hash = golden});
    const auto bytes = write_sampler_package(sampler, *body.package);
    ASSERT_TRUE(bytes.ok()) << bytes.status().message();
    ASSERT_TRUE(ports::write_file_atomically(folder_.path(name), *bytes).ok());
  }

  static Result<std::vector<std::byte>> write_sampler_package(const Sampler& sampler,
                                                              const Package& body) {
    return figurine::write_sampler(
        {.sampler = &sampler,
         .budget = {.gaussians = body.body().texel_count()},
         .provenance = {
             .tool = "test", .licence_name = "CC0-1.0", .depicted_person = "synthetic"}});
  }

  void SetUp() override {
    tests::write_test_packages(folder_);
    write_sampler("crowd.fgn");
  }

  ProgramRun run(const std::string& arguments, const std::string& before = "",
                 const std::string& environment = "") {
    return run_figurine(arguments,
                        {.environment = environment, .before = before, .folder = folder_.path()});
  }
  // What seed 0's weights are on this device, as a sampler says it of its golden seeds.
  std::array<uint64_t, 2> hash_of_seed_0() {
    const ProgramRun sampled = run("sample crowd.fgn --seed 0 --json -o x.fgn");
    const auto hex = nlohmann::json::parse(sampled.out).at("weights_hash").get<std::string>();
    const std::array<uint64_t, 2> hash = {std::stoull(hex.substr(16), nullptr, 16),
                                          std::stoull(hex.substr(0, 16), nullptr, 16)};
    EXPECT_EQ(format_hash(hash), hex);
    return hash;
  }

  TestFolder folder_;
};

TEST_F(SampleCommand, TheSameSeedIsTheSameFile) {
  ASSERT_EQ(run("sample crowd.fgn --seed 7 -o a.fgn").exit_code, 0);
  ASSERT_EQ(run("sample crowd.fgn --seed 7 -o b.fgn").exit_code, 0);
  ASSERT_EQ(run("sample crowd.fgn --seed 8 -o c.fgn").exit_code, 0);
  EXPECT_EQ(folder_.read("a.fgn"), folder_.read("b.fgn"));
  EXPECT_NE(folder_.read("a.fgn"), folder_.read("c.fgn"));
}

TEST_F(SampleCommand, WhatIsSampledPassesItsSelftestAndIsDrawn) {
  for (const char* precision : {"q8", "f32,q8"}) {
    ASSERT_EQ(
        run(std::string("sample crowd.fgn --seed 7 -o a.fgn --precision ") + precision).exit_code,
        0)
        << precision;
    const ProgramRun selftest = run("selftest a.fgn --precision q8");
    EXPECT_EQ(selftest.exit_code, 0) << selftest.err;
    EXPECT_EQ(run("render a.fgn --motion motion.fgn --frames 0 --size 64x64 -o a.png").exit_code,
              0);
  }
  ASSERT_EQ(run("sample crowd.fgn --seed 7 -o f.fgn --precision f32").exit_code, 0);
  EXPECT_EQ(run("render f.fgn --size 64x64 -o f.png").exit_code, 0);
}

TEST_F(SampleCommand, JsonSaysSeedSolverAndCost) {
  const ProgramRun json_run =
      run("sample crowd.fgn --seed 7 --steps 4 --solver ddim --json -o a.fgn");
  ASSERT_EQ(json_run.exit_code, 0) << json_run.err;
  const nlohmann::json json = nlohmann::json::parse(json_run.out);
  EXPECT_EQ(json.at("command"), "sample");
  EXPECT_EQ(json.at("seed"), 7);
  EXPECT_EQ(json.at("solver"), "ddim");
  EXPECT_EQ(json.at("evaluations"), 4);
  EXPECT_EQ(json.at("weights_hash").get<std::string>().size(), 32u);
  EXPECT_GT(json.at("seconds").at("sample").get<double>(), 0);
  EXPECT_GT(json.at("macs_per_evaluation").get<uint64_t>(), 1000u);
}

TEST_F(SampleCommand, BlendsEndAtTheirSeeds) {
  const auto hash = [&](const std::string& arguments) {
    const ProgramRun one = run("sample crowd.fgn --json -o x.fgn " + arguments);
    EXPECT_EQ(one.exit_code, 0) << one.err;
    return nlohmann::json::parse(one.out).at("weights_hash").get<std::string>();
  };
  EXPECT_EQ(hash("--seed 1 --to 2 --mix 0"), hash("--seed 1"));
  EXPECT_EQ(hash("--seed 1 --to 2 --mix 1"), hash("--seed 2"));
  EXPECT_NE(hash("--seed 1 --to 2 --mix 0.5"), hash("--seed 1"));
}

TEST_F(SampleCommand, TheTraceIsAPictureAStepAndAStrip) {
  ASSERT_EQ(run("sample crowd.fgn --seed 7 --trace steps -o a.fgn").exit_code, 0);
  EXPECT_TRUE(folder_.has("steps/step_0000.png"));
  EXPECT_TRUE(folder_.has("steps/step_0005.png"));
  EXPECT_FALSE(folder_.has("steps/step_0006.png"));
  EXPECT_TRUE(folder_.has("steps/strip.png"));
  // Watching changes nothing.
  ASSERT_EQ(run("sample crowd.fgn --seed 7 -o b.fgn").exit_code, 0);
  EXPECT_EQ(folder_.read("a.fgn"), folder_.read("b.fgn"));
}

TEST_F(SampleCommand, GoldenSeedsAreHeldAgainstThisDevice) {
  const ProgramRun none = run("selftest crowd.fgn");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.err.find("golden seeds"), std::string::npos) << none.err;

  const std::array<uint64_t, 2> hash = hash_of_seed_0();
  write_sampler("golden.fgn", hash);
  const ProgramRun right = run("selftest golden.fgn --json");
  EXPECT_EQ(right.exit_code, 0) << right.err;
  EXPECT_TRUE(nlohmann::json::parse(right.out).at("passed").get<bool>());
  write_sampler("wrong.fgn", {hash[0] + 1, hash[1]});
  const ProgramRun wrong = run("selftest wrong.fgn");
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_NE(wrong.err.find("seed 0"), std::string::npos) << wrong.err;
  EXPECT_EQ(wrong.error_lines(), 1u);
}

// The dial's order is the slope over the three finest settings that stand above its noise floor.
void expect_order_above_the_floor(const nlohmann::json& dial) {
  const double floor = dial.at("noise_floor");
  std::vector<std::pair<double, double>> above;  // log step, log error; up to the finest above
  std::vector<std::pair<double, double>> all;
  for (const nlohmann::json& setting : dial.at("settings")) {
    const double rmse = setting.at("rmse");
    EXPECT_GE(rmse, floor);
    all.emplace_back(std::log(setting.at("value").get<double>()), std::log(rmse));
    if (rmse > 4 * floor) above = all;
  }
  ASSERT_GE(above.size(), 3u) << dial.dump();
  const auto [coarse_step, coarse_error] = above[above.size() - 3];
  const auto [fine_step, fine_error] = above.back();
  EXPECT_NEAR(dial.at("observed_order").get<double>(),
              (coarse_error - fine_error) / (coarse_step - fine_step), 1e-9);
  EXPECT_NE(dial.at("observed_over").get<std::string>().find("above the noise floor"),
            std::string::npos);
}

TEST_F(SampleCommand, TheReportHasADialForEachSolver) {
  const ProgramRun result = run("report crowd.fgn --seeds 2 -o report --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  ASSERT_EQ(json.at("dials").size(), 2u);
  EXPECT_EQ(json.at("dials")[0].at("theoretical_order"), 2);
  EXPECT_EQ(json.at("dials")[1].at("theoretical_order"), 1);
  for (const nlohmann::json& dial : json.at("dials")) {
    const nlohmann::json& settings = dial.at("settings");
    EXPECT_EQ(settings.front().at("work").at("evaluations"), 1);
    EXPECT_EQ(settings.back().at("work").at("evaluations"), 250);
    EXPECT_LT(settings.back().at("rmse").get<double>(), settings.front().at("rmse").get<double>());
    EXPECT_GT(settings.back().at("work").at("macs").get<uint64_t>(),
              settings.front().at("work").at("macs").get<uint64_t>());
    expect_order_above_the_floor(dial);
  }
  EXPECT_NE(folder_.read("report/report.html").find("seed 0, the reference"), std::string::npos);
  EXPECT_EQ(run("report crowd.fgn --body other_body.fgn -o nowhere").exit_code, 1);
  EXPECT_FALSE(folder_.has("nowhere"));
}

// Of the sampling and of what is drawn of it, in every command that samples.
TEST_F(SampleCommand, AnInstructionSetIsNamedByOptionOrEnvironment) {
  write_sampler("golden.fgn", hash_of_seed_0());
  const std::vector<std::string> before = folder_.names();
  for (const std::string command :
       {"sample crowd.fgn --seed 7 --trace steps -o a.fgn", "selftest golden.fgn",
        "report golden.fgn --seeds 1 -o report"}) {
    const ProgramRun option = run(command + " --isa mmx");
    EXPECT_EQ(option.exit_code, 1) << command;
    EXPECT_NE(option.err.find("isa 'mmx' is unsupported"), std::string::npos) << option.err;
    const ProgramRun variable = run(command, "", "FIGURINE_ISA=mmx ");
    EXPECT_EQ(variable.exit_code, 1) << command;
    EXPECT_NE(variable.err.find("FIGURINE_ISA: isa 'mmx'"), std::string::npos) << variable.err;
    EXPECT_EQ(folder_.names(), before) << command;

    const ProgramRun named = run(command + " --isa baseline --json", "", "FIGURINE_ISA=mmx ");
    ASSERT_EQ(named.exit_code, 0) << named.err;
    const nlohmann::json machine = nlohmann::json::parse(named.out).at("machine");
    EXPECT_EQ(machine.at("isa"), "baseline") << command;
    EXPECT_EQ(machine.at("precision"), "q8") << command;
    EXPECT_EQ(machine.at("threads"), 1) << command;
    EXPECT_GE(machine.at("cpus").get<int>(), 1) << command;
    for (const char* written : {"a.fgn", "steps", "report"})
      std::filesystem::remove_all(folder_.path(written));
  }
}

// As it lies in a checkout: the sampler's body is in the folder of its population.
TEST_F(SampleCommand, TheShippedSamplerFindsItsBody) {
  const ProgramRun result =
      run("sample '" FIGURINE_SOURCE_DIR "/samples/samplers/edge.fgn' --seed 7 --steps 1 -o x.fgn");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(folder_.has("x.fgn"));
}

TEST_F(SampleCommand, BadInputGetsOneLineAndNoFile) {
  const struct {
    const char *arguments, *word;
  } cases[] = {
      {"sample avatar.fgn --seed 1 -o x.fgn", "not sampler"},
      {"sample nowhere.fgn --seed 1 -o x.fgn", "nowhere.fgn"},
      {"sample crowd.fgn --seed 1 -o x.png", ".fgn"},
      {"sample crowd.fgn --seed 1 --to 2 -o x.fgn", "--mix"},
      {"sample crowd.fgn --seed 1 --mix 0.5 -o x.fgn", "--to"},
      {"sample crowd.fgn --seed 1 --body other_body.fgn -o x.fgn", "other_body.fgn"},
      {"sample crowd.fgn --seed 1 -o nowhere/x.fgn", "nowhere/x.fgn"},
      {"render crowd.fgn -o x.png", "figurine sample"},
  };
  const std::vector<std::string> before = folder_.names();
  for (const auto& bad : cases) {
    const ProgramRun result = run(bad.arguments);
    EXPECT_EQ(result.exit_code, 1) << bad.arguments;
    EXPECT_EQ(result.error_lines(), 1u) << result.err;
    EXPECT_NE(result.err.find(bad.word), std::string::npos) << result.err;
  }
  EXPECT_EQ(folder_.names(), before);
}

TEST_F(SampleCommand, AMalformedCommandLineIsUsage) {
  for (const char* arguments : {"sample crowd.fgn -o x.fgn", "sample crowd.fgn --seed -1 -o x.fgn",
                                "sample crowd.fgn --seed 1 --steps 0 -o x.fgn",
                                "sample crowd.fgn --seed 1 --steps 1001 -o x.fgn",
                                "sample crowd.fgn --seed 1 --solver euler -o x.fgn",
                                "sample crowd.fgn --seed 1 --to 2 --mix 1.5 -o x.fgn"}) {
    EXPECT_EQ(run(arguments).exit_code, 2) << arguments;
  }
}

TEST_F(SampleCommand, AFullDiskLeavesNothing) {
  const std::vector<std::string> before = folder_.names();
  const ProgramRun result =
      run("sample crowd.fgn --seed 1 --precision f32,q8 -o x.fgn", "trap '' XFSZ; ulimit -f 1;");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_EQ(folder_.names(), before);
}

}  // namespace
}  // namespace figurine::sample_command_test
