// What is said of a command line, on an app of the test's own.
#include "ports/command_line/command_line.h"

#include <gtest/gtest.h>

#include "ports/command_line/values.h"
#include "ports/command_line/words.h"

namespace figurine::ports::command_line_test {
namespace {

std::string said(CLI::Validator validator, std::string text) { return validator(text); }

TEST(CommandLineValues, SayTheirRangeAsAPersonWould) {
  EXPECT_EQ(said(between(1, 64), "65"), "'65': not a whole number from 1 to 64");
  EXPECT_EQ(said(between(1, 64), "64"), "");
  EXPECT_EQ(said(between(1, 64), "1.5"), "'1.5': not a whole number from 1 to 64");
  EXPECT_EQ(said(between(1, UINT32_MAX - 1), "4294967294"), "");
  EXPECT_NE(said(between(1, UINT32_MAX - 1), "4294967295"), "");
  EXPECT_NE(said(between(0, UINT64_MAX), "18446744073709551616"), "");
  EXPECT_EQ(said(between(0, UINT64_MAX), "18446744073709551615"), "");
  EXPECT_EQ(said(between(-80, 80), "-80"), "");
  EXPECT_NE(said(between(-80, 80), "-81"), "");
  EXPECT_EQ(said(between(0.0, 1.0), "nan"), "'nan': not a number from 0 to 1");
  EXPECT_EQ(said(between(1e-9, 0.5), "2"), "'2': not a number from 1e-09 to 0.5");
  EXPECT_EQ(said(positive(), "0"), "'0': not a number above 0");
  EXPECT_EQ(said(positive(), "inf"), "'inf': not a number above 0");
  EXPECT_EQ(said(not_negative(), "0"), "");
  EXPECT_EQ(said(not_negative(), "-1"), "'-1': not a number from 0 on");
  EXPECT_EQ(said(any_count(), "-0"), "");
  EXPECT_EQ(said(any_count(), "-1"), "'-1': not a whole number from 0 on");
  EXPECT_EQ(said(one_of({"body", "bust", "head"}), "feet"), "'feet': none of body, bust and head");
  EXPECT_EQ(said(one_of({"body", "bust", "head"}), "bost"),
            "'bost': none of body, bust and head; did you mean bust or body?");
  EXPECT_EQ(said(one_of_or_whole_number({"on", "off"}, 1, 10), "11"),
            "'11': neither on, off nor a whole number from 1 to 10");
  EXPECT_NE(said(one_of_or_whole_number({"on", "off"}, 1, 10), "2.5"), "");
  EXPECT_EQ(said(one_of_or_number({"on", "off"}, 0, 1000), "2.5"), "");
  EXPECT_EQ(said(json_destination(), "x.fgn"), "'x.fgn': neither - nor a name that ends in .json");
}

TEST(CommandLineValues, AreShownOnOneLine) {
  EXPECT_EQ(in_quotes("a\nb\x1b[2J\x7f"), "'a?b?[2J?'");
  EXPECT_EQ(in_quotes("gr\xc3\xbc\xc3\x9f"), "'gr\xc3\xbc\xc3\x9f'");
  EXPECT_EQ(in_quotes(std::string(1000, 'x')).size(), 85u);
}

struct Values {
  std::string name, json;
  std::vector<std::string> words, list;
  uint32_t count = 0;
  double share = 0;
  bool flag = false;
};

std::optional<std::string> refused(std::vector<std::string> words, Values& values) {
  CLI::App app("a test", "program");
  app.require_subcommand(1);
  CLI::App* make = app.add_subcommand("make", "Makes");
  make->add_option("words", values.words, "words")->required();
  make->add_option("-n,--name", values.name, "a name");
  make->add_option("--count", values.count, "how many");
  make->add_option("--share", values.share, "of all");
  make->add_option("--list", values.list, "A,B")->delimiter(',');
  make->add_flag("--flag", values.flag, "a flag");
  add_json_option(*make, values.json);
  app.add_subcommand("mend", "Mends");
  return refuse_command_line(app, words);
}
std::string refused(const std::vector<std::string>& words) {
  Values values;
  return refused(words, values).value_or("taken");
}

TEST(CommandLine, SaysWhatIsWrong) {
  EXPECT_EQ(refused({}), "which command? There is make and mend");
  EXPECT_EQ(refused({"mkae", "x"}), "there is no command 'mkae'; did you mean make?");
  EXPECT_EQ(refused({"paint"}), "there is no command 'paint'");
  EXPECT_EQ(refused({"make"}), "make: words is required");
  EXPECT_EQ(refused({"make", "--nmae", "x"}),
            "make: there is no option '--nmae'; did you mean --name?");
  EXPECT_EQ(refused({"make", "--colour=red", "x"}), "make: there is no option '--colour'");
  EXPECT_EQ(refused({"make", "x", "-z"}), "make: there is no option '-z'");
  EXPECT_EQ(refused({"make", "x", "--name"}), "make: --name: its value is missing");
  EXPECT_EQ(refused({"make", "x", "--name", "a", "--name", "b"}),
            "make: --name: is given more than once");
  EXPECT_EQ(refused({"make", "x", "--count", "1.5"}),
            "make: --count: '1.5': not a whole number from 0 on");
  EXPECT_EQ(refused({"make", "x", "--share", "half"}), "make: --share: 'half': not a number");
  EXPECT_EQ(refused({"mend", "x"}), "mend: 'x': nothing more is expected here");
}

TEST(CommandLine, EmptyIsNotTheSameAsNotGiven) {
  EXPECT_EQ(refused({"make", ""}), "argument 2: is empty");
  EXPECT_EQ(refused({"make", "x", "--name", ""}), "--name: is empty");
  EXPECT_EQ(refused({"make", "x", "-n", ""}), "-n: is empty");
  EXPECT_EQ(refused({"make", "x", "--name="}), "--name: is empty");
  EXPECT_EQ(refused({"make", "x", "--list", ",,", "--flag"}), "--list: is empty");
  EXPECT_EQ(refused({"make", "x", "--json", ""}), "--json: is empty");
}

TEST(CommandLine, JsonMayStandAlone) {
  for (const auto& [words, json, arguments] :
       std::vector<std::tuple<std::vector<std::string>, std::string, size_t>>{
           {{"make", "x"}, "", 1},
           {{"make", "x", "--json"}, "-", 1},
           {{"make", "--json", "x"}, "-", 1},
           {{"make", "--json", "x", "y.fgn"}, "-", 2},
           {{"make", "x", "--json", "-"}, "-", 1},
           {{"make", "x", "--json", "out/y.json"}, "out/y.json", 1},
           {{"make", "--json", "y.json", "x"}, "y.json", 1},
           {{"make", "x", "--json=y.json"}, "y.json", 1},
           {{"make", "x", "--json", "--flag"}, "-", 1},
           {{"make", "x", "--json", "/dev/full"}, "/dev/full", 1}}) {
    Values values;
    EXPECT_EQ(refused(words, values), std::nullopt);
    EXPECT_EQ(values.json, json);
    EXPECT_EQ(values.words.size(), arguments) << json;
  }
  EXPECT_EQ(refused({"make", "x", "--json=y.fgn"}),
            "make: --json: 'y.fgn': neither - nor a name that ends in .json");
}

TEST(CommandLine, OptionsOfOthersSayWhatIsWrongThemselves) {
  std::string value;
  bool flag = false;
  const std::vector<TextOption> options = {
      {"--even", "an even number", false,
       [&](const std::string& text) {
         value = text;
         return text == "2" ? Status()
                            : Status(StatusCode::kInvalidArgument, "'" + text + "': odd");
       }},
      {"--loud", "aloud", true, [&](const std::string&) {
         flag = true;
         return Status();
       }}};
  CLI::App app("a test", "program");
  add_text_options(app, options);
  EXPECT_EQ(refuse_command_line(app, std::vector<std::string>{"--even", "3"}), "--even: '3': odd");
  EXPECT_EQ(refuse_command_line(app, std::vector<std::string>{"--even", "2", "--loud"}),
            std::nullopt);
  EXPECT_EQ(value, "2");
  EXPECT_TRUE(flag);
}

}  // namespace
}  // namespace figurine::ports::command_line_test
