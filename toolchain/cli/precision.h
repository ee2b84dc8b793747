// --precision of all trainings: what matrices are multiplied in.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "ports/command_line/values.h"
#include "toolchain/train/settings.h"

namespace figurine::cli {

// Adds --precision. T: a string, or an optional one.
template <class T>
CLI::Option* add_precision_option(CLI::App& command, T& precision, const std::string& help) {
  return command.add_option("--precision", precision, help)
      ->check(ports::one_of({"auto", "f32", "bf16"}));
}

// precision: what add_precision_option takes. "auto": where the CPU multiplies bfloat16.
inline bool asks_for_bf16(const std::string& precision) {
  return precision == "bf16" || (precision == "auto" && train::has_fast_bf16());
}

}  // namespace figurine::cli
