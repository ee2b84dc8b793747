// What the value of an option may be, said as a person would: in the error and in --help. In place
// of CLI11's own validators, which say "Value 65 not in range [1 - 64]".
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

namespace figurine::ports {

// "'65': not a whole number from 1 to 64". Both ends belong to it.
CLI::Validator whole_number_between(int64_t least, uint64_t most);
// "'1.5': not a number from 0 to 1". Both ends belong to it; NaN is no number.
CLI::Validator number_between(double least, double most);
// Whole numbers, if both ends are.
template <class Least, class Most>
CLI::Validator between(Least least, Most most) {
  if constexpr (std::is_integral_v<Least> && std::is_integral_v<Most>) {
    return whole_number_between(static_cast<int64_t>(least), static_cast<uint64_t>(most));
  } else {
    return number_between(static_cast<double>(least), static_cast<double>(most));
  }
}

CLI::Validator positive();      // "'0': not a number above 0"
CLI::Validator not_negative();  // "'-1': not a number from 0 on"
CLI::Validator any_number();
CLI::Validator any_whole_number();
CLI::Validator any_count();  // a whole number from 0 on

// "'feet': none of body, bust and head", with the nearest of them where one is near.
CLI::Validator one_of(std::vector<std::string> words);
// A word, or a number in place of one: "'x': neither on, off nor a whole number from 1 to 10".
CLI::Validator one_of_or_whole_number(std::vector<std::string> words, int64_t least, uint64_t most);
CLI::Validator one_of_or_number(std::vector<std::string> words, double least, double most);

// A file for JSON, or - for standard output: "'x': neither - nor a name that ends in .json".
CLI::Validator json_destination();

}  // namespace figurine::ports
