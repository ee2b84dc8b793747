// --threads of all commands: no more than usable CPUs, unless --force-threads is given.
#pragma once

#include <CLI/CLI.hpp>

namespace figurine::cli {

// Adds --force-threads, which may stand anywhere. Before the commands are added.
void add_force_threads(CLI::App& app, int argc, const char* const* argv);

// For Option::transform: a number of threads above that of usable CPUs becomes that, with a line on
// standard error.
CLI::Validator usable_threads();

}  // namespace figurine::cli
