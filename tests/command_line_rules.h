// The rules of docs/command_line.md, held against every command and option that a program has: a
// new one that breaks a rule fails here.
#pragma once

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "ports/command_line/command_line.h"

namespace figurine::tests {

// A program's app, with all that its options write to.
using AppMaker = std::function<std::shared_ptr<CLI::App>()>;

// A command as words, {"evaluate", "members"}; {} is the program itself.
using CommandPath = std::vector<std::string>;

inline void collect_commands(const CLI::App& app, const CommandPath& path,
                             std::vector<CommandPath>& paths) {
  paths.push_back(path);
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* each) { return !each->get_name().empty(); })) {
    CommandPath longer = path;
    longer.push_back(command->get_name());
    collect_commands(*command, longer, paths);
  }
}

inline std::vector<CommandPath> all_commands(const CLI::App& app) {
  std::vector<CommandPath> paths;
  collect_commands(app, {}, paths);
  return paths;
}

inline const CLI::App& command_at(const CLI::App& app, const CommandPath& path) {
  const CLI::App* at = &app;
  for (const std::string& name : path) at = at->get_subcommand(name);
  return *at;
}

// Those of its option groups too, without --help and --version.
inline std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  std::vector<const CLI::Option*> options;
  for (const CLI::Option* option : command.get_options()) {
    if (option->check_lname("help") || option->check_lname("version")) continue;
    options.push_back(option);
  }
  for (const CLI::App* group :
       command.get_subcommands([](const CLI::App* each) { return each->get_name().empty(); })) {
    for (const CLI::Option* option : options_of(*group)) options.push_back(option);
  }
  return options;
}

inline std::string text_of(const CommandPath& path) {
  std::string text;
  for (const std::string& word : path) text += word + " ";
  return text;
}

// What is said of a command with more words behind it; "" where it would run, which no call here
// may come to: names of files are left out.
inline std::string said_of(CLI::App& app, CommandPath words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  try {
    return ports::refuse_command_line(app, words).value_or("");
  } catch (const CLI::Success&) {
    return "";
  }
}

// A person's words, on one line.
inline void expect_plain(const std::string& said, const std::string& where) {
  EXPECT_NE(said, "") << where << "is taken";
  for (const char* foreign : {"\n", "[", "{", "not in range", "Could not", "UINT", "FLOAT", "TEXT",
                              "e+308", "e-308", "At Most"})
    EXPECT_EQ(said.find(foreign), std::string::npos) << where << ": " << said;
}

inline void expect_empty_values_are_errors(const AppMaker& make) {
  const std::shared_ptr<CLI::App> app = make();
  for (const CommandPath& path : all_commands(*app)) {
    for (const CLI::Option* option : options_of(command_at(*app, path))) {
      for (const std::string& name : option->get_lnames()) {
        if (option->get_type_size() == 0) continue;
        const std::string where = text_of(path) + "--" + name;
        EXPECT_EQ(said_of(*app, path, {"--" + name, ""}), "--" + name + ": is empty") << where;
        EXPECT_EQ(said_of(*app, path, {"--" + name + "="}), "--" + name + ": is empty") << where;
      }
    }
    EXPECT_EQ(said_of(*app, path, {""}),
              "argument " + std::to_string(path.size() + 1) + ": is empty");
  }
}

inline void expect_wrong_values_are_said_plainly(const AppMaker& make) {
  size_t numbers = 0;
  const std::shared_ptr<CLI::App> app = make();
  for (const CommandPath& path : all_commands(*app)) {
    for (const CLI::Option* option : options_of(command_at(*app, path))) {
      const std::string type = option->get_type_name();
      const bool number =
          type.starts_with("UINT") || type.starts_with("INT") || type.starts_with("FLOAT");
      const bool checked = type.find(':') != std::string::npos;
      if (option->get_lnames().empty() || option->get_type_size() == 0) continue;
      const std::string name = "--" + option->get_lnames().front();
      if (number || checked) {
        ++numbers;
        const std::string said = said_of(*app, path, {name, "no-such-value"});
        expect_plain(said, text_of(path) + name);
        EXPECT_NE(said.find(name + ": 'no-such-value': n"), std::string::npos) << said;
      }
      if (number) {
        for (const char* wrong : {"nan", "inf", "1e999", "7seven"})
          expect_plain(said_of(*app, path, {name + "=" + wrong}), text_of(path) + name + wrong);
      }
    }
  }
  EXPECT_GT(numbers, 0u);
}

inline void expect_mistyped_names_are_recognised(const AppMaker& make) {
  const std::shared_ptr<CLI::App> app = make();
  for (const CommandPath& path : all_commands(*app)) {
    for (const CLI::Option* option : options_of(command_at(*app, path))) {
      for (const std::string& name : option->get_lnames()) {
        if (name.size() < 4) continue;
        std::string wrong = name;
        std::swap(wrong[1], wrong[2]);
        if (wrong == name) wrong.erase(1, 1);
        const std::string said = said_of(*app, path, {"--" + wrong, "x"});
        EXPECT_NE(said.find("there is no option '--" + wrong + "'; did you mean --"),
                  std::string::npos)
            << text_of(path) << said;
        EXPECT_NE(said.find("--" + name), std::string::npos) << said;
      }
    }
    if (path.empty()) continue;
    CommandPath wrong = path;
    wrong.back().erase(wrong.back().size() - 2, 1);
    const std::string said = said_of(*app, wrong, {});
    EXPECT_NE(said.find("there is no command '" + wrong.back() + "'; did you mean "),
              std::string::npos)
        << said;
    EXPECT_NE(said.find(path.back()), std::string::npos) << said;
  }
}

inline void expect_help_is_plain(const AppMaker& make) {
  const std::shared_ptr<CLI::App> app = make();
  for (const CommandPath& path : all_commands(*app)) {
    const CLI::App& command = command_at(*app, path);
    EXPECT_NE(command.get_description(), "") << text_of(path);
    for (const CLI::Option* option : options_of(command))
      EXPECT_NE(option->get_description(), "") << text_of(path) << option->get_name();
    const std::string help = command.help();
    for (const char* foreign :
         {"UINT", "FLOAT", "POSITIVE", "NONNEGATIVE", " in [", ":{", "{false}"})
      EXPECT_EQ(help.find(foreign), std::string::npos) << text_of(path) << foreign << "\n" << help;
  }
}

// Options of these names take and mean the same wherever there are any, but for their defaults.
// others: "COMMAND NAME" of those that are something else.
inline void expect_shared_options_agree(const AppMaker& make, const std::set<std::string>& names,
                                        const std::set<std::string>& others = {}) {
  const std::shared_ptr<CLI::App> app = make();
  for (const std::string& name : names) {
    std::string first, first_where;
    for (const CommandPath& path : all_commands(*app)) {
      for (const CLI::Option* option : options_of(command_at(*app, path))) {
        if (!option->check_lname(name) || others.contains(text_of(path) + name)) continue;
        const std::string text = option->get_description();
        const std::string is =
            option->get_type_name() + " " + text.substr(0, text.find("; default"));
        if (first_where.empty()) first = is, first_where = text_of(path);
        EXPECT_EQ(is, first) << "--" << name << " of " << text_of(path) << "and " << first_where;
      }
    }
    EXPECT_NE(first_where, "") << "--" << name << ": nobody has it";
  }
}

}  // namespace figurine::tests
