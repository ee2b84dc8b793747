#include "toolchain/dataset/opencv_yaml.h"

#include <cmath>
#include <cstdlib>

#include "toolchain/dataset/read_file.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r");
  return first == std::string::npos
             ? ""
             : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::string unquoted(const std::string& text) {
  const bool quoted = text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
                      text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

}  // namespace

class OpencvYaml::Parser {
 public:
  Parser(const std::string& text, OpencvYaml& yaml) : text_(text), yaml_(yaml) {}

  void run() {
    std::string line;
    while (next(line)) {
      const std::string content = trimmed(line);
      if (content.empty() || content.starts_with('%') || content.starts_with('#') ||
          content == "---" || content == "...")
        continue;
      const size_t colon = content.find(':');
      const bool indented = line[0] == ' ' || line[0] == '\t';
      if (content.starts_with('-') && node_ != nullptr && !node_->matrix) {
        add(trimmed(content.substr(1)));
      } else if (colon == std::string::npos) {
        fail("is no \"KEY: value\"");
      } else if (indented) {
        field(trimmed(content.substr(0, colon)), trimmed(content.substr(colon + 1)));
      } else {
        begin(unquoted(trimmed(content.substr(0, colon))), trimmed(content.substr(colon + 1)));
      }
    }
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(yaml_.path_ + ": line " + std::to_string(line_) + ": " + reason);
  }

  bool next(std::string& line) {
    if (at_ >= text_.size()) return false;
    const size_t end = std::min(text_.find('\n', at_), text_.size());
    line = text_.substr(at_, end - at_);
    at_ = end + 1;
    ++line_;
    return true;
  }

  void begin(const std::string& key, const std::string& value) {
    const auto [place, fresh] = yaml_.nodes_.try_emplace(key);
    if (!fresh) fail(key + ": stands twice");
    node_ = &place->second;
    if (value.starts_with("!!opencv-matrix")) {
      node_->matrix = true;
    } else if (value.starts_with('[')) {
      list(value);
    } else if (!value.empty()) {
      add(value);
    }
  }

  // Of a matrix.
  void field(const std::string& key, const std::string& value) {
    if (node_ == nullptr || !node_->matrix) fail(key + ": belongs to nothing");
    if (key == "rows" || key == "cols") {
      char* end = nullptr;
      const unsigned long count = std::strtoul(value.c_str(), &end, 10);
      if (value.empty() || *end != '\0' || count > 1'000'000) fail(key + ": is no size");
      (key == "rows" ? node_->rows : node_->columns) = count;
    } else if (key == "data") {
      list(value);
    } else if (key != "dt") {
      fail(key + ": is unknown in a matrix");
    }
  }

  // "[ a, b,", which may go on over several lines.
  void list(std::string value) {
    if (!value.starts_with('[')) fail("is no list");
    std::string line;
    while (value.find(']') == std::string::npos) {
      if (!next(line)) fail("the list does not end");
      value += " " + trimmed(line);
    }
    value = value.substr(1, value.find(']') - 1);
    for (size_t from = 0; from < value.size();) {
      const size_t comma = std::min(value.find(',', from), value.size());
      const std::string item = trimmed(value.substr(from, comma - from));
      if (!item.empty()) add(item);
      from = comma + 1;
    }
  }

  void add(const std::string& item) { node_->items.push_back(item); }

  const std::string& text_;
  OpencvYaml& yaml_;
  Node* node_ = nullptr;
  size_t at_ = 0, line_ = 0;
};

OpencvYaml OpencvYaml::read(const std::string& path) {
  OpencvYaml yaml;
  yaml.path_ = path;
  const std::string text = read_text_file(path);
  Parser(text, yaml).run();
  return yaml;
}

const OpencvYaml::Node& OpencvYaml::find(const std::string& key) const {
  const auto found = nodes_.find(key);
  if (found == nodes_.end()) throw InputError(path_ + ": " + key + ": missing");
  return found->second;
}

std::vector<double> OpencvYaml::numbers(const std::string& key, size_t count) const {
  const Node& node = find(key);
  const auto fail = [&](const std::string& reason) {
    throw InputError(path_ + ": " + key + ": " + reason);
  };
  std::vector<double> values;
  for (const std::string& item : node.items) {
    char* end = nullptr;
    const double value = std::strtod(item.c_str(), &end);
    if (*end != '\0' || end == item.c_str()) fail("'" + item + "' is no number");
    if (!std::isfinite(value)) fail("'" + item + "' is not a finite number");
    values.push_back(value);
  }
  if (node.matrix && node.rows * node.columns != values.size()) {
    fail("is of " + std::to_string(node.rows) + " x " + std::to_string(node.columns) + ", has " +
         std::to_string(values.size()) + " numbers");
  }
  if (count != 0 && values.size() != count)
    fail("has " + std::to_string(values.size()) + " numbers, expected " + std::to_string(count));
  return values;
}

std::vector<std::string> OpencvYaml::texts(const std::string& key) const {
  std::vector<std::string> out;
  for (const std::string& item : find(key).items) out.push_back(unquoted(item));
  return out;
}

}  // namespace figurine::dataset
