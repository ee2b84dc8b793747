// Reads JSON from outside: every access says which file and field was wrong, and no number that is
// not finite gets through.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "toolchain/error.h"

namespace figurine::dataset {

// One value and the words for where it stands: "FILE: a.b".
class JsonField {
 public:
  JsonField(const nlohmann::json& value, std::string where)
      : value_(value), where_(std::move(where)) {}

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(where_ + ": " + reason);
  }

  bool has(const char* key) const { return value_.is_object() && value_.contains(key); }

  JsonField operator[](const std::string& key) const {
    if (!value_.is_object()) fail("not an object");
    const auto found = value_.find(key);
    if (found == value_.end()) throw InputError(inside(key) + ": missing");
    return {*found, inside(key)};
  }

  // All numbers of an array, rows of rows flattened; count 0 means any.
  std::vector<double> numbers(size_t count = 0) const {
    std::vector<double> out;
    append_numbers(value_, out);
    if (count != 0 && out.size() != count)
      fail("has " + std::to_string(out.size()) + " numbers, expected " + std::to_string(count));
    return out;
  }

  double number() const { return numbers(1)[0]; }

  uint64_t whole() const {
    if (!value_.is_number_unsigned()) fail("not a whole number");
    return value_.get<uint64_t>();
  }

  std::string text() const {
    if (!value_.is_string()) fail("not a text");
    return value_.get<std::string>();
  }

  bool boolean() const {
    if (!value_.is_boolean()) fail("not true or false");
    return value_.get<bool>();
  }

  std::vector<JsonField> items() const {
    if (!value_.is_array()) fail("not a list");
    std::vector<JsonField> out;
    for (size_t i = 0; i < value_.size(); ++i)
      out.push_back({value_[i], where_ + "[" + std::to_string(i) + "]"});
    return out;
  }

  const nlohmann::json& json() const { return value_; }
  const std::string& where() const { return where_; }

 private:
  std::string inside(const std::string& key) const {
    return where_ + (where_.ends_with(": ") ? "" : ".") + key;
  }

  void append_numbers(const nlohmann::json& value, std::vector<double>& out) const {
    if (value.is_array()) {
      for (const nlohmann::json& item : value) append_numbers(item, out);
      return;
    }
    if (!value.is_number()) fail("not a number");
    out.push_back(value.get<double>());
    if (!std::isfinite(out.back())) fail("not a finite number");
  }

  const nlohmann::json& value_;
  std::string where_;
};

}  // namespace figurine::dataset
