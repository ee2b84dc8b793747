// A text as a field of a table in CSV: quotes are doubled, as RFC 4180 asks, and lines become one.
#pragma once

#include <string>

namespace figurine::train {

inline std::string csv_quoted(const std::string& text) {
  std::string out = "\"";
  for (char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c == '\n' ? ' ' : c);
  return out + '"';
}

}  // namespace figurine::train
