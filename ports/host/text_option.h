// An option of a command line as words: for what reads options without knowing what parses them.
#pragma once

#include <functional>
#include <string>

#include "figurine/status.h"

namespace figurine::ports {

// `set` takes the text behind the name ("" for a flag) and says what is wrong with it.
struct TextOption {
  const char* name;  // "--fps"
  const char* help;
  bool is_flag = false;
  std::function<Status(const std::string& text)> set;
};

}  // namespace figurine::ports
