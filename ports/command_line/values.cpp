#include "ports/command_line/values.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "ports/command_line/words.h"
#include "ports/host/nearest_names.h"

namespace figurine::ports {

namespace {

template <class T>
bool parse(const std::string& text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

bool is_whole(const std::string& text, int64_t least, uint64_t most) {
  if (!text.starts_with('-')) {
    uint64_t value = 0;
    return parse(text, value) && value <= most && (least <= 0 || value >= uint64_t(least));
  }
  int64_t value = 0;
  return parse(text, value) && value >= least && (value < 0 || uint64_t(value) <= most);
}

bool is_number(const std::string& text, double least, double most) {
  double value = 0;
  return parse(text, value) && std::isfinite(value) && value >= least && value <= most;
}

std::string plain(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

// help: what stands behind the option in --help; is: whether a text is a value; wrong: what one is
// told that is none, behind the text itself.
template <class Is>
CLI::Validator validator(const std::string& help, const std::string& wrong, Is is) {
  return CLI::Validator(
      [is, wrong](std::string& text) {
        return is(std::as_const(text)) ? std::string() : in_quotes(text) + ": " + wrong;
      },
      help);
}

bool holds(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

}  // namespace

CLI::Validator whole_number_between(int64_t least, uint64_t most) {
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  return validator(range, "not a whole number from " + range,
                   [=](const std::string& text) { return is_whole(text, least, most); });
}

CLI::Validator number_between(double least, double most) {
  const std::string range = plain(least) + " to " + plain(most);
  return validator(range, "not a number from " + range,
                   [=](const std::string& text) { return is_number(text, least, most); });
}

CLI::Validator positive() {
  return validator("above 0", "not a number above 0", [](const std::string& text) {
    return is_number(text, std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
  });
}

CLI::Validator not_negative() {
  return validator("from 0 on", "not a number from 0 on", [](const std::string& text) {
    return is_number(text, 0, std::numeric_limits<double>::max());
  });
}

CLI::Validator any_number() {
  return validator("", "not a number", [](const std::string& text) {
    return is_number(text, std::numeric_limits<double>::lowest(),
                     std::numeric_limits<double>::max());
  });
}

CLI::Validator any_whole_number() {
  return validator("", "not a whole number", [](const std::string& text) {
    return is_whole(text, std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max());
  });
}

CLI::Validator any_count() {
  return validator("", "not a whole number from 0 on", [](const std::string& text) {
    return is_whole(text, 0, std::numeric_limits<uint64_t>::max());
  });
}

CLI::Validator one_of(std::vector<std::string> words) {
  const std::string help = joined(words, "|");
  return CLI::Validator(
      [words = std::move(words)](std::string& text) {
        if (holds(words, text)) return std::string();
        const std::vector<std::string> nearest = nearest_names(text, words);
        return in_quotes(text) + ": none of " + in_words(words, "and") + did_you_mean(nearest);
      },
      help);
}

CLI::Validator one_of_or_whole_number(std::vector<std::string> words, int64_t least,
                                      uint64_t most) {
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  return validator(
      joined(words, "|") + "|" + range,
      "neither " + joined(words, ", ") + " nor a whole number from " + range,
      [=](const std::string& text) { return holds(words, text) || is_whole(text, least, most); });
}

CLI::Validator one_of_or_number(std::vector<std::string> words, double least, double most) {
  const std::string range = plain(least) + " to " + plain(most);
  return validator(
      joined(words, "|") + "|" + range,
      "neither " + joined(words, ", ") + " nor a number from " + range,
      [=](const std::string& text) { return holds(words, text) || is_number(text, least, most); });
}

CLI::Validator json_destination() {
  return validator("", "neither - nor a name that ends in .json", [](const std::string& text) {
    return text == "-" || text.ends_with(".json") || text.starts_with("/dev/");
  });
}

}  // namespace figurine::ports
