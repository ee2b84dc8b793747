#include "ports/command_line/command_line.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <new>
#include <vector>

#include "ports/command_line/values.h"
#include "ports/command_line/words.h"
#include "ports/host/nearest_names.h"
#include "ports/host/process.h"

namespace figurine::ports {

namespace {

// What an option takes: "N (1 to 64)", "body|bust|head", "TEXT".
class Help final : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool positional) const override {
    std::string text = CLI::Formatter::make_option_name(option, positional);
    constexpr std::string_view kOff = "{false}";  // CLI11's mark of --no-antialiased
    for (size_t at = 0; (at = text.find(kOff)) != std::string::npos;) text.erase(at, kOff.size());
    return text;
  }
  std::string make_option_opts(const CLI::Option* option) const override {
    const bool flag = option->get_type_size() == 0;
    const std::string type = flag ? "" : option->get_type_name();
    const size_t colon = type.find(':');
    const std::string kind = type.substr(0, colon);
    std::string range = colon == std::string::npos ? "" : type.substr(colon + 1);
    const bool whole = kind == "UINT" || kind == "INT", number = whole || kind == "FLOAT";
    std::string text;
    if (number) {
      text = std::string(whole ? " N" : " X") + (range.empty() ? "" : " (" + range + ")");
    } else if (!flag) {
      text = " " + (range.empty() ? kind : range);
    }
    if (!flag && !option->get_default_str().empty() && option->get_expected_min() > 0)
      text += " [" + option->get_default_str() + "]";
    if (!flag && option->get_expected_max() == CLI::detail::expected_max_vector_size)
      text += " ...";
    if (option->get_required()) text += " (required)";
    for (const CLI::Option* other : option->get_needs()) text += " with " + other->get_name();
    for (const CLI::Option* other : option->get_excludes())
      text += " not with " + other->get_name();
    return text;
  }
};

// The command that was named, and the words up to it: "render", "evaluate members", "".
struct Asked {
  const CLI::App* app;
  std::string path;
};

Asked asked_command(const CLI::App& top) {
  Asked asked{&top, ""};
  while (true) {
    const std::vector<const CLI::App*> parsed = asked.app->get_subcommands(
        [](const CLI::App* app) { return app->parsed() && !app->get_name().empty(); });
    if (parsed.empty()) return asked;
    asked.app = parsed.back();
    asked.path += (asked.path.empty() ? "" : " ") + asked.app->get_name();
  }
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* each) { return !each->get_name().empty(); }))
    names.push_back(command->get_name());
  return names;
}

// Of the command, its groups and what commands share; without dashes.
void add_option_names(const CLI::App& app, std::vector<std::string>& names) {
  for (const CLI::Option* option : app.get_options()) {
    const std::vector<std::string>& own = option->get_lnames();
    names.insert(names.end(), own.begin(), own.end());
  }
  for (const CLI::App* group :
       app.get_subcommands([](const CLI::App* each) { return each->get_name().empty(); }))
    add_option_names(*group, names);
}

std::string say_unknown_option(const CLI::App& top, const CLI::App& app, const std::string& word) {
  const std::string name = word.substr(0, word.find('='));
  std::vector<std::string> names;
  add_option_names(app, names);
  if (&app != &top && app.get_fallthrough()) add_option_names(top, names);
  std::vector<std::string> nearest;
  if (name.starts_with("--")) nearest = nearest_names(name.substr(2), names);
  for (std::string& each : nearest) each = "--" + each;
  return "there is no option " + in_quotes(name) + did_you_mean(nearest);
}

// Words that nobody took: what is said of the first of them.
std::optional<std::string> say_unknown(const CLI::App& top, const Asked& asked) {
  std::vector<std::string> left = asked.app->remaining();
  if (left.empty() && asked.app != &top) left = top.remaining();
  if (left.empty()) return std::nullopt;
  const std::string& word = left.front();
  if (word.starts_with("-") && word.size() > 1) return say_unknown_option(top, *asked.app, word);
  const std::vector<std::string> commands = command_names(*asked.app);
  if (!commands.empty()) {
    return "there is no command " + in_quotes(word) + did_you_mean(nearest_names(word, commands));
  }
  return in_quotes(word) + ": nothing more is expected here";
}

// CLI11's own words where they are not a person's.
std::string say_error(const Asked& asked, const CLI::ParseError& error) {
  const std::string what = error.what();
  const auto name = [&] { return what.substr(0, what.find(": ")); };
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    if (what.starts_with("A subcommand"))
      return "which command? There is " + in_words(command_names(*asked.app), "and");
    const size_t open = what.find('['), close = what.find(']');
    if (open != std::string::npos && close != std::string::npos)
      return "exactly one is required of " + what.substr(open + 1, close - open - 1);
    return what;  // "avatars is required"
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    if (what.ends_with(" missing")) return name() + ": its value is missing";
    if (what.find("At Most") != std::string::npos) return name() + ": is given more than once";
  }
  if (dynamic_cast<const CLI::RequiresError*>(&error) != nullptr)
    return what.substr(0, what.find(" requires ")) + ": needs" +
           what.substr(what.find(" requires ") + 9);
  if (dynamic_cast<const CLI::ExcludesError*>(&error) != nullptr)
    return what.substr(0, what.find(" excludes ")) + ": cannot stand beside" +
           what.substr(what.find(" excludes ") + 9);
  return what;
}

// Numbers are numbers, whatever else is asked of them. Once, however often a line is parsed.
void check_numbers(CLI::App& app) {
  constexpr const char* kName = "a number";
  const auto is_checked = [&](CLI::Option* option) {
    try {
      return option->get_validator(kName) != nullptr;
    } catch (const CLI::OptionNotFound&) {
      return false;
    }
  };
  for (CLI::Option* option : app.get_options({})) {
    const std::string type = option->get_type_name();
    const std::string kind = type.substr(0, type.find(':'));
    if (kind != "UINT" && kind != "INT" && kind != "FLOAT") continue;
    if (is_checked(option)) continue;
    option->check((kind == "UINT"  ? any_count()
                   : kind == "INT" ? any_whole_number()
                                   : any_number())
                      .name(kName));
  }
  for (CLI::App* command : app.get_subcommands({})) check_numbers(*command);
}

// No option and no argument takes nothing: what a script leaves empty by mistake is told so, not
// taken for "not given". A list of nothing but commas is as empty.
std::optional<std::string> say_empty(std::span<const std::string> words) {
  const auto is_empty = [](std::string_view text) {
    return text.find_first_not_of(',') == std::string_view::npos;
  };
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const size_t equals = word.find('=');
    if (word.starts_with("--") && equals != std::string::npos &&
        is_empty(std::string_view(word).substr(equals + 1)))
      return word.substr(0, equals) + ": is empty";
    if (!is_empty(word)) continue;
    if (i > 0 && words[i - 1].size() > 1 && words[i - 1].starts_with("-"))
      return words[i - 1] + ": is empty";
    return "argument " + std::to_string(i + 1) + ": is empty";
  }
  return std::nullopt;
}

std::string behind(const std::string& path, const std::string& reason) {
  return path.empty() ? reason : path + ": " + reason;
}

}  // namespace

int run_program(const char* name, const std::function<int()>& run) {
  prepare_process(name);
  int code = kBug;
  try {
    code = run();
  } catch (const std::bad_alloc&) {
    say("out of memory");
    code = kBadInput;
  } catch (const std::exception& error) {
    say(std::string("internal error: ") + error.what());
  }
  const Status printed = flush_standard_output();
  if (code != kDone || printed.ok()) return code;
  say(printed.message());
  return kBadInput;
}

void prepare_help(CLI::App& app) { app.formatter(std::make_shared<Help>()); }

std::optional<std::string> refuse_command_line(CLI::App& app, std::span<const std::string> words) {
  if (std::optional<std::string> empty = say_empty(words)) return empty;
  check_numbers(app);
  std::vector<std::string> reversed(words.rbegin(), words.rend());
  try {
    app.parse(std::move(reversed));
    return std::nullopt;
  } catch (const CLI::Success&) {
    throw;
  } catch (const CLI::ParseError& error) {
    const Asked asked = asked_command(app);
    // First of all: a mistyped name leaves its value to be taken for something else.
    const std::optional<std::string> unknown = say_unknown(app, asked);
    return behind(asked.path, unknown ? *unknown : say_error(asked, error));
  }
}

std::optional<int> parse_command_line(CLI::App& app, int argc, const char* const* argv) {
  const std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  try {
    const std::optional<std::string> refused = refuse_command_line(app, words);
    if (!refused) return std::nullopt;
    const std::string path = asked_command(app).path;
    say(*refused + " (" + app.get_name() + (path.empty() ? "" : " " + path) + " --help)");
    return kUsage;
  } catch (const CLI::Success& success) {  // --help, --version
    app.exit(success);
    return kDone;
  }
}

void add_text_options(CLI::App& app, std::span<const TextOption> options) {
  for (const TextOption& option : options) {
    const auto set = [option](const std::string& text) {
      const Status status = option.set(text);
      if (!status.ok()) throw CLI::ValidationError(option.name, status.message());
    };
    if (option.is_flag) {
      app.add_flag_callback(option.name, [set] { set(""); }, option.help);
    } else {
      app.add_option_function<std::string>(option.name, set, option.help);
    }
  }
}

CLI::Option* add_json_option(CLI::App& app, std::string& text) {
  // A word behind it is its value only where it can be one, so that --json may stand before
  // arguments.
  app.validate_optional_arguments();
  return app
      .add_option("--json", text,
                  "the summary as JSON, to this file; without a name, or -, to standard output")
      ->type_name("[FILE.json]")
      ->check(json_destination())
      ->expected(0, 1)
      ->default_str("-");
}

}  // namespace figurine::ports
