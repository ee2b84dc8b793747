// The rules of docs/command_line.md, over all commands of figurine.
#include "command_line_rules.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "samples/figurine/commands.h"
#include "samples/program.h"

namespace figurine::tests::command_line_test {
namespace {

using Json = nlohmann::json;

std::shared_ptr<CLI::App> make_figurine() {
  struct Program {
    CLI::App app{"test", "figurine"};
    std::vector<samples::Command> commands = samples::add_commands(app);
  };
  const auto program = std::make_shared<Program>();
  return {program, &program->app};
}

TEST(CommandLine, EmptyValuesAreErrors) { expect_empty_values_are_errors(make_figurine); }
TEST(CommandLine, WrongValuesAreSaidPlainly) {
  expect_wrong_values_are_said_plainly(make_figurine);
}
TEST(CommandLine, MistypedNamesAreRecognised) {
  expect_mistyped_names_are_recognised(make_figurine);
  EXPECT_EQ(said_of(*make_figurine(), {"rendr"}, {"x.fgn", "-o", "x.png"}),
            "there is no command 'rendr'; did you mean render?");
}
TEST(CommandLine, HelpIsPlain) { expect_help_is_plain(make_figurine); }

TEST(CommandLine, SharedOptionsMeanTheSame) {
  expect_shared_options_agree(make_figurine,
                              {"threads",
                               "force-threads",
                               "isa",
                               "json",
                               "body",
                               "camera",
                               "framing",
                               "follow",
                               "place",
                               "spacing",
                               "coarse",
                               "crowd",
                               "network-hz",
                               "network-below-px",
                               "coarse-below-px",
                               "averted-above",
                               "sh-degree",
                               "fast-blend",
                               "keep",
                               "size",
                               "near"},
                              {"motion body"});
  // What draws or samples has what the device's commands have; what only rewrites a file has none.
  const std::set<std::string> rewrites = {"motion", "pose"};
  const std::shared_ptr<CLI::App> app = make_figurine();
  for (const CommandPath& path : all_commands(*app)) {
    if (path.empty()) continue;
    const CLI::App& command = command_at(*app, path);
    for (const char* name : {"--threads", "--force-threads", "--isa"}) {
      EXPECT_EQ(command.get_option_no_throw(name) != nullptr, !rewrites.contains(path[0]))
          << path[0] << name;
    }
    EXPECT_NE(command.get_option_no_throw("--json"), nullptr) << path[0];
    EXPECT_EQ(command.get_option_no_throw("--precision") != nullptr,
              !rewrites.contains(path[0]) && path[0] != "splat")
        << path[0];
  }
}

// One call of every command that succeeds: what it prints, and where.
struct Call {
  std::string arguments;
  bool prints_a_result = false;  // without --json
};
const std::map<std::string, Call>& calls() {
  static const std::map<std::string, Call> table = {
      {"bench", {"P/avatar.fgn --frames 1 --threads 1 --size 16x16", true}},
      {"export", {"P/avatar.fgn -o x.ply"}},
      {"live", {"P/avatar.fgn --pose P/motion.fgn --frames 1 --size 16x16 -o x.y4m"}},
      {"motion",
       {FIGURINE_SOURCE_DIR "/tests/data/cases/bvh-reference/in.bvh --body " FIGURINE_SOURCE_DIR
                            "/samples/packages/body-64.fgn -o x.fgn"}},
      {"pose", {"--from P/motion.fgn -o x.json"}},
      {"render", {"P/avatar.fgn --size 16x16 -o x.png"}},
      {"report", {"P/avatar.fgn --frames 1 --size 16x16 -o r"}},
      {"sample", {FIGURINE_SOURCE_DIR "/samples/samplers/edge.fgn --seed 1 --steps 1 -o x.fgn"}},
      {"selftest",
       {FIGURINE_SOURCE_DIR "/samples/packages/person-coarse.fgn --precision q8", true}},
      {"splat", {"P/scene.ply --size 16x16 -o x.png"}},
  };
  return table;
}

class CommandOutput : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    packages_ = new TestFolder;
    write_test_packages(*packages_);
    // The smallest scene: one Gaussian.
    std::string header =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
        "property float opacity\nproperty float scale_0\nproperty float scale_1\n"
        "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
        "property float rot_2\nproperty float rot_3\nend_header\n";
    packages_->write("scene.ply", header + "0 0 0 0 0 0 2 -1 -1 -1 1 0 0 0\n");
  }
  static void TearDownTestSuite() { delete packages_; }

  static std::string with_paths(std::string text) {
    for (size_t at = 0; (at = text.find("P/", at)) != std::string::npos;) {
      if (at > 0 && text[at - 1] != ' ') {
        ++at;
        continue;
      }
      text.replace(at, 1, packages_->path());
      at += packages_->path().size();
    }
    return text;
  }
  ProgramRun run(const std::string& command, const std::string& more) const {
    return run_shell(std::string("'") + figurine_program() + "' " + command + " " +
                         with_paths(" " + calls().at(command).arguments) + " " + more,
                     folder_);
  }

  static TestFolder* packages_;
  TestFolder folder_;
};
TestFolder* CommandOutput::packages_ = nullptr;

TEST_F(CommandOutput, EveryCommandHasItsCall) {
  for (const CommandPath& path : all_commands(*make_figurine())) {
    if (!path.empty()) {
      EXPECT_TRUE(calls().contains(path[0])) << path[0];
    }
  }
}

// Standard output is for what was asked for; words about the work go to standard error, behind the
// program's name.
TEST_F(CommandOutput, WordsGoToStandardErrorAndResultsToStandardOutput) {
  for (const auto& [command, call] : calls()) {
    const ProgramRun plain = run(command, "");
    EXPECT_EQ(plain.exit_code, 0) << command << plain.err;
    EXPECT_EQ(plain.out != "", call.prints_a_result) << command << plain.out;
    const ProgramRun json = run(command, "--json");
    EXPECT_EQ(json.exit_code, 0) << command << json.err;
    EXPECT_EQ(Json::parse(json.out, nullptr, false)["command"], command) << json.out;
    const ProgramRun file = run(command, "--json said.json");
    EXPECT_EQ(file.out != "", call.prints_a_result) << command << file.out;
    EXPECT_EQ(Json::parse(folder_.read("said.json"), nullptr, false)["command"], command);
    for (const std::string& words : {plain.err, json.err, file.err}) {
      std::istringstream lines(words);
      for (std::string line; std::getline(lines, line);)
        EXPECT_TRUE(line.starts_with("figurine: ")) << command << ": " << line;
    }
  }
}

TEST_F(CommandOutput, ALostStandardOutputIsAnError) {
  const auto expect_lost = [&](const std::string& command, const std::string& more) {
    for (const char* nowhere : {" > /dev/full", " >&-"}) {
      const ProgramRun result = run(command, more + nowhere);
      EXPECT_EQ(result.exit_code, 1) << command << more << nowhere;
      EXPECT_NE(result.err.find("figurine: standard output: what was printed is lost"),
                std::string::npos)
          << command << more << nowhere << ": " << result.err;
    }
  };
  for (const auto& [command, call] : calls()) {
    expect_lost(command, "--json");
    expect_lost(command, "--help");
    if (call.prints_a_result) expect_lost(command, "");
  }
  const ProgramRun pose = run_shell(std::string("'") + figurine_program() + "' pose --from '" +
                                        packages_->path("motion.fgn") + "' > /dev/full",
                                    folder_);
  EXPECT_EQ(pose.exit_code, 1);
  EXPECT_EQ(pose.error_lines(), 1u) << pose.err;
}

// What cannot be the value of --json is an argument like others: no package is written over.
TEST_F(CommandOutput, JsonTakesNoPackageForItsFile) {
  const std::string before = packages_->read("avatar.fgn");
  const ProgramRun made = run_shell(std::string("'") + figurine_program() + "' render --json '" +
                                        packages_->path("avatar.fgn") + "' --size 16x16 -o x.png",
                                    folder_);
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(Json::parse(made.out)["command"], "render");
  EXPECT_EQ(packages_->read("avatar.fgn"), before);
  const ProgramRun refused =
      run_shell(std::string("'") + figurine_program() + "' render --json=x.fgn '" +
                    packages_->path("avatar.fgn") + "' --size 16x16 -o x.png",
                folder_);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("--json: 'x.fgn': neither - nor a name that ends in .json"),
            std::string::npos)
      << refused.err;
}

}  // namespace
}  // namespace figurine::tests::command_line_test
