// --threads of all commands: no more than usable CPUs, unless --force-threads is given.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "ports/command_line/values.h"

namespace figurine::cli {

// Adds --force-threads, which may stand anywhere. Before the commands are added.
void add_force_threads(CLI::App& app, int argc, const char* const* argv);

// For Option::transform: a number of threads above that of usable CPUs becomes that, with a line on
// standard error.
CLI::Validator usable_threads();

// Adds --threads. T: a number, or an optional one.
template <class T>
CLI::Option* add_threads_option(CLI::App& command, T& threads, const std::string& help) {
  return command.add_option("--threads", threads, help)
      ->check(ports::between(1, 256))
      ->transform(usable_threads());
}

}  // namespace figurine::cli
