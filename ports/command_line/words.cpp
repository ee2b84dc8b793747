#include "ports/command_line/words.h"

namespace figurine::ports {

std::string in_quotes(std::string_view text) {
  constexpr size_t kLongest = 80;
  std::string shown = "'";
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);  // UTF-8 stays as it is
    shown += byte < ' ' || byte == 127 ? '?' : c;
  }
  return shown + (text.size() > kLongest ? "...'" : "'");
}

std::string in_words(std::span<const std::string> words, const char* last) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 < words.size() ? ", " : std::string(" ") + last + " ";
    text += words[i];
  }
  return text;
}

std::string did_you_mean(std::span<const std::string> names) {
  return names.empty() ? "" : "; did you mean " + in_words(names, "or") + "?";
}

}  // namespace figurine::ports
