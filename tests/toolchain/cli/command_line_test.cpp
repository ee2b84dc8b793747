// The rules of docs/command_line.md, over all commands of figurine-train.
#include "command_line_rules.h"

#include <gtest/gtest.h>

#include "samples/program.h"
#include "toolchain/cli/commands.h"

namespace figurine::cli::command_line_test {
namespace {

using namespace tests;

std::shared_ptr<CLI::App> make_train() {
  auto app = std::make_shared<CLI::App>("test", "figurine-train");
  const char* const argv[] = {"figurine-train"};
  add_commands(*app, 1, argv);
  return app;
}

TEST(TrainCommandLine, EmptyValuesAreErrors) { expect_empty_values_are_errors(make_train); }
TEST(TrainCommandLine, WrongValuesAreSaidPlainly) {
  expect_wrong_values_are_said_plainly(make_train);
}
TEST(TrainCommandLine, MistypedNamesAreRecognised) {
  expect_mistyped_names_are_recognised(make_train);
}
TEST(TrainCommandLine, HelpIsPlain) { expect_help_is_plain(make_train); }

ProgramRun train(const TestFolder& folder, const std::string& arguments) {
  return run_shell("'" FIGURINE_TRAIN "' " + arguments, folder);
}

TEST(TrainCommandLine, WordsGoToStandardErrorAndResultsToStandardOutput) {
  const TestFolder folder;
  const std::string body = "body --mannequin --uv 32 -o b.fgn";
  const ProgramRun made = train(folder, body);
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_TRUE(made.out.starts_with("part   charts")) << made.out;
  EXPECT_TRUE(made.err.starts_with("figurine-train: b.fgn: ")) << made.err;
  const ProgramRun moved = train(folder, "motion " FIGURINE_SOURCE_DIR
                                         "/tests/data/cases/bvh-reference/in.bvh --body b.fgn "
                                         "-o m.fgn");
  EXPECT_EQ(moved.exit_code, 0) << moved.err;
  EXPECT_EQ(moved.out, "");
  for (const std::string& command : {body, std::string("body --help"), std::string("--version")}) {
    for (const char* nowhere : {" > /dev/full", " >&-"}) {
      const ProgramRun lost = train(folder, command + nowhere);
      EXPECT_EQ(lost.exit_code, 1) << command << nowhere;
      EXPECT_NE(lost.err.find("figurine-train: standard output: what was printed is lost"),
                std::string::npos)
          << lost.err;
    }
  }
}

TEST(TrainCommandLine, AWrongLineIsUsageInOneLine) {
  const TestFolder folder;
  for (const auto& [arguments, wanted] :
       {std::pair{"", "figurine-train: which command? There is body, motion, capture"},
        {"pak run -o x.fgn", "figurine-train: there is no command 'pak'; did you mean pack?"},
        {"body --uv 32 -o x.fgn", "body: exactly one is required of --smplx,"},
        {"body --mannequin --uv 7 -o x.fgn", "body: --uv: '7': not a whole number from 8 to "},
        {"evaluate member", "there is no command 'member'; did you mean members?"},
        {"features --population a.fgn --body '' -o x.safetensors", "--body: is empty"}}) {
    const ProgramRun run = train(folder, arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(wanted), std::string::npos) << run.err;
    EXPECT_EQ(run.out, "") << arguments;
    EXPECT_TRUE(folder.names().empty()) << arguments;
  }
}

}  // namespace
}  // namespace figurine::cli::command_line_test
