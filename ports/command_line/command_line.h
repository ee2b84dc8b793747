// The command line of every program of figurine, so that all of them say the same of the same
// mistake and end alike (docs/command_line.md). CLI11 parses; its words stay here.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "ports/host/text_option.h"

namespace figurine::ports {

// Exit codes of all programs.
inline constexpr int kDone = 0;      // what was asked for is there, and what was printed arrived
inline constexpr int kBadInput = 1;  // a file, a value, the machine; or standard output is lost
inline constexpr int kUsage = 2;     // the command line itself
inline constexpr int kBug = 3;       // figurine's own

// main() of a program: what ports/host/process.h asks for first and last, and what becomes of
// exceptions that nobody took (out of memory: kBadInput; others: kBug). name must stay.
int run_program(const char* name, const std::function<int()>& run);

// For --help: what an option takes in a person's words. Call before options are added, so that
// subcommands inherit it.
void prepare_help(CLI::App& app);

// Parses the command line, with the callbacks of commands that have one. No value: go on.
// Otherwise the exit code: kDone after --help and --version, kUsage after one line on standard
// error. Other exceptions of callbacks pass through. The app's name is the program's.
//
// Beside what CLI11 refuses: empty words and values. Of unknown commands and options it names the
// nearest there is.
std::optional<int> parse_command_line(CLI::App& app, int argc, const char* const* argv);

// The same without printing: no value, or the line behind the program's name. --help and --version
// are still CLI::Success.
std::optional<std::string> refuse_command_line(CLI::App& app, std::span<const std::string> words);

// Options that something else reads (ports/motion/import.h).
void add_text_options(CLI::App& app, std::span<const TextOption> options);

// --json [FILE]: text becomes "-" without a file, and stays empty where the option is not given.
CLI::Option* add_json_option(CLI::App& app, std::string& text);

}  // namespace figurine::ports
