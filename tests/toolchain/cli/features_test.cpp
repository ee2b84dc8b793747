// figurine-train features and evaluate features, the way a user runs them: a network is trained and
// judged; what is wrong is one line and no file.
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "gtest/gtest.h"
#include "samples/program.h"
#include "toolchain/features/people.h"

namespace figurine::cli::features_test {
namespace {

using tests::ProgramRun;
using tests::TestFolder;

// body.fgn and six.fgn: two members train, four are held out.
void write_packages(const TestFolder& folder) {
  tests::write_test_packages(folder);
  features::test::write_people(folder.path("six.fgn"), {.training = 2, .validation = 2, .test = 2});
}

ProgramRun train(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(
      FIGURINE_TRAIN " features --threads 2 --iterations 4 --poses 2 --views 2 --batch 8 " +
          arguments,
      folder);
}

ProgramRun judge(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(FIGURINE_TRAIN " evaluate features " + arguments +
                              " -o report.json --threads 2 --poses 2 --views 2 --first-pose 2",
                          folder);
}

TEST(FeaturesCommand, TrainsANetworkThatCanBeJudged) {
  const TestFolder folder;
  write_packages(folder);
  const ProgramRun trained =
      train(folder, "--population six.fgn --body body.fgn --motion motion.fgn -o f.safetensors");
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  EXPECT_NE(trained.err.find("4 iterations"), std::string::npos) << trained.err;
  EXPECT_FALSE(folder.has("f.safetensors.checkpoint"));
  EXPECT_LT(std::filesystem::file_size(folder.path("f.safetensors")), 1'000'000u);
  const ProgramRun again =
      train(folder, "--population six.fgn --body body.fgn -o f.safetensors --resume");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NE(again.err.find("was finished"), std::string::npos) << again.err;

  const ProgramRun judged = judge(folder, "six.fgn --body body.fgn --features f.safetensors");
  ASSERT_EQ(judged.exit_code, 0) << judged.err;
  std::ifstream file(folder.path("report.json"));
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_EQ(report.at("held_out").at("members"), 4);
  EXPECT_EQ(report.at("training").at("members"), 2);
  EXPECT_TRUE(report.at("held_out").at("features").contains("figurine-features"));
  EXPECT_EQ(report.at("networks").at("figurine-features").at("provenance").at("population"),
            "people");
  for (const char* word : {"LPIPS", "FID"})
    EXPECT_EQ(report.dump().find(word), std::string::npos) << "it is neither";
}

TEST(FeaturesCommand, BadInputGivesOneLineAndNothingElse) {
  const TestFolder folder;
  write_packages(folder);
  folder.write("text.pt", "no script");
  const std::vector<std::string> before = folder.names();
  const auto refused = [&](const ProgramRun& run, const std::string& wanted) {
    EXPECT_EQ(run.exit_code, 1) << wanted;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(wanted), std::string::npos) << run.err;
    EXPECT_EQ(folder.names(), before) << wanted;
  };
  refused(train(folder, "--population none.fgn --body body.fgn -o f.safetensors"), "none.fgn");
  refused(train(folder, "--population avatar.fgn --body body.fgn -o f.safetensors"),
          "is a package of kind avatar, not population");
  refused(train(folder, "--population six.fgn --body other_body.fgn -o f.safetensors"),
          "made for ");
  refused(train(folder, "--population six.fgn --body body.fgn -o f.npz"),
          "--output: 'f.npz' must end in .safetensors");
  refused(train(folder, "--population six.fgn --body body.fgn -o f.safetensors --resume"),
          "no training to resume");
  refused(judge(folder, "six.fgn --body body.fgn"), "give --features, --lpips or --inception");
  refused(judge(folder, "six.fgn --body body.fgn --features none.safetensors"), "none.safetensors");
  refused(judge(folder, "six.fgn --body body.fgn --lpips text.pt"),
          "text.pt: not a TorchScript file");
  refused(judge(folder, "six.fgn --body body.fgn --inception text.pt"),
          "text.pt: not a TorchScript file");
  EXPECT_EQ(train(folder, "--population six.fgn -o f.safetensors").exit_code, 2);
  EXPECT_EQ(judge(folder, "six.fgn --body body.fgn --poses 1").exit_code, 2);
}

}  // namespace
}  // namespace figurine::cli::features_test
