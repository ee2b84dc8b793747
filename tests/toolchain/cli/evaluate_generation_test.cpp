// figurine-train evaluate generation, the way a user runs it without a sampler: the rows that need
// no training, by PSNR alone and through a network as well.
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "gtest/gtest.h"
#include "samples/program.h"
#include "toolchain/features/people.h"
#include "toolchain/population/small_recipe.h"

namespace figurine::cli::evaluate_generation_test {
namespace {

using tests::ProgramRun;
using tests::TestFolder;

ProgramRun judge(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(
      FIGURINE_TRAIN
          " evaluate generation --body body.fgn --threads 2 --replicates 20 -o report.json " +
          arguments,
      folder);
}

nlohmann::json report_of(const TestFolder& folder) {
  std::ifstream file(folder.path("report.json"));
  return nlohmann::json::parse(file);
}

const nlohmann::json& row_of(const nlohmann::json& report, const std::string& name) {
  const nlohmann::json& rows = report.at("rows");
  return *std::find_if(rows.begin(), rows.end(),
                       [&](const nlohmann::json& row) { return row.at("name") == name; });
}

TEST(EvaluateGeneration, HoldsRowsAgainstBothPartsThroughANetworkToo) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  features::test::write_people(folder.path("people.fgn"),
                               {.training = 4, .validation = 1, .test = 1});
  const ProgramRun trained =
      tests::run_shell(FIGURINE_TRAIN
                       " features --threads 2 --iterations 2 --poses 2 --views 2 --batch 8"
                       " --population people.fgn --body body.fgn -o f.safetensors",
                       folder);
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  const ProgramRun plain = judge(folder, "--population people.fgn");
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  const nlohmann::json without = report_of(folder);
  EXPECT_EQ(without.at("networks"), nlohmann::json::object());
  for (const char* word : {"perceptual", "frechet", "kid"})
    EXPECT_EQ(without.at("rows").dump().find(word), std::string::npos) << word;

  const ProgramRun run = judge(folder, "--population people.fgn --features f.safetensors");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("figurine-features\n"), std::string::npos) << run.out;
  const nlohmann::json report = report_of(folder);
  EXPECT_EQ(report.at("networks").at("figurine-features").at("hash").get<std::string>().size(),
            32u);
  EXPECT_EQ(report.at("rows").size(), 9u)
      << "two Gaussians, three averages, noise, the memoriser; training and held-out members";
  for (const nlohmann::json& row : report.at("rows")) {
    for (const char* part : {"held_out", "train"}) {
      if (!row.contains(part)) continue;
      const nlohmann::json& near = row.at(part).at("perceptual").at("figurine-features");
      for (const char* key : {"mmd", "coverage_percent", "one_nna_percent"}) {
        for (const char* of : {"value", "low", "high"})
          EXPECT_TRUE(near.at(key).at(of).is_number()) << row.at("name") << ' ' << key;
      }
      EXPECT_TRUE(near.at("one_nna_off_ideal").is_number());
      EXPECT_TRUE(row.at(part).at("kid").at("figurine-features").at("value").is_number());
      EXPECT_EQ(row.at(part).at("frechet").at("figurine-features").at("left_out"),
                part == std::string("train") ? "24 pictures are too few for 32 features"
                                             : "12 pictures are too few for 32 features");
      for (const char* key : {"mmd_psnr_db", "coverage_percent", "one_nna_percent"}) {
        EXPECT_EQ(row.at(part).at(key), row_of(without, row.at("name")).at(part).at(key))
            << "as without networks";
      }
    }
  }
  const nlohmann::json& copies =
      row_of(report, "perfect memoriser").at("novelty").at("perceptual").at("figurine-features");
  EXPECT_EQ(copies.at("copy_share"), 1);
  EXPECT_EQ(copies.at("median_ratio"), 0);
  EXPECT_GT(row_of(report, "held-out members")
                .at("novelty")
                .at("perceptual")
                .at("figurine-features")
                .at("median_ratio"),
            0);
  EXPECT_TRUE(row_of(report, "training members")
                  .at("held_out")
                  .at("perceptual")
                  .contains("figurine-features"));
  for (const char* word : {"LPIPS", "FID"})
    EXPECT_EQ(report.dump().find(word), std::string::npos) << "it is neither";
}

// What ships can be judged by whoever has the package: no run folder is needed.
TEST(EvaluateGeneration, JudgesASamplersPackageByTheDevicesOwnIntegers) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  features::test::write_people(folder.path("people.fgn"),
                               {.training = 4, .validation = 1, .test = 1});
  const ProgramRun made = tests::run_shell(
      FIGURINE_TRAIN
      " sampler --quiet --population people.fgn --size small --blocks 1 --rank 3 --members 3 "
      "--precision bf16 --iterations 2 -o run && " FIGURINE_TRAIN
      " pack run --body body.fgn -o sampler.fgn",
      folder);
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(
      nlohmann::json::parse(std::ifstream(folder.path("run/run.json"))).at("settings").at("bf16"),
      true);
  const ProgramRun run = judge(
      folder, "--population people.fgn --no-baselines --sampler ours=sampler.fgn --run float=run");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json report = report_of(folder);
  const nlohmann::json &device = row_of(report, "ours"), &network = row_of(report, "float");
  EXPECT_EQ(device.at("learnt_from"), 3);
  EXPECT_EQ(network.at("learnt_from"), 3);
  EXPECT_EQ(device.at("held_out").at("draws").at("count"), 2) << "four people, two held out";
  const double of_device = device.at("novelty").at("weights").at("median_nearest"),
               of_network = network.at("novelty").at("weights").at("median_nearest");
  EXPECT_NEAR(of_device / of_network, 1, 0.02)
      << "the same people but for the rounding of matrices and directions";
  EXPECT_NE(of_device, of_network);
  EXPECT_EQ(report.at("runs").at(0).at("package").at("name"), "people");
  EXPECT_FALSE(report.at("runs").at(1).contains("package"));

  features::test::write_people(folder.path("others.fgn"),
                               {.training = 4, .validation = 1, .test = 1, .other_from = 0});
  const ProgramRun refused = judge(folder, "--population others.fgn --sampler sampler.fgn");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
  EXPECT_NE(refused.err.find("sampler.fgn: population: learnt from "), std::string::npos)
      << refused.err;
}

TEST(EvaluateGeneration, BadInputGivesOneLineAndNoReport) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  features::test::write_people(folder.path("three.fgn"),
                               {.training = 3, .validation = 2, .test = 2});
  folder.write("text.pt", "no script");
  const auto refused = [&](const std::string& arguments, const std::string& wanted) {
    const ProgramRun run = judge(folder, arguments);
    EXPECT_EQ(run.exit_code, 1) << wanted;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(wanted), std::string::npos) << run.err;
    EXPECT_FALSE(folder.has("report.json")) << wanted;
  };
  refused("--population none.fgn", "none.fgn");
  refused("--population three.fgn --features none.safetensors", "none.safetensors");
  refused("--population three.fgn --lpips text.pt", "text.pt: not a TorchScript file");
  refused("--population three.fgn --inception text.pt", "text.pt: not a TorchScript file");
  refused("--population three.fgn", "has more held-out members than training ones");
  folder.write("other.json", testing_tools::small_recipe().dump());
  refused("--population three.fgn --recipe none.json", "none.json");
  refused("--population three.fgn --recipe other.json",
          "other.json: name: 'small' is not the recipe of population 'people'");
}

}  // namespace
}  // namespace figurine::cli::evaluate_generation_test
