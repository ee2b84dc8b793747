// Text of messages about a command line: one line, fit for a terminal.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace figurine::ports {

// In quotes; what is no printable character becomes '?', what is long is cut.
std::string in_quotes(std::string_view text);
// "a, b and c".
std::string in_words(std::span<const std::string> words, const char* last);
// "; did you mean --framing?", "; did you mean a or b?"; empty for none.
std::string did_you_mean(std::span<const std::string> names);

}  // namespace figurine::ports
