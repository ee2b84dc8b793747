// The JSON of a glTF file, as its readers see it: fields that know what they are called, and errors
// that are kept instead of thrown. Internal.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "figurine/status.h"

namespace figurine::ports {

// Text of the file for a message or a name: short and on one line.
std::string gltf_excerpt(const std::string& text, size_t longest = 128);

// The first thing that was wrong.
struct FieldError {
  std::string text;  // empty: nothing
  bool ok() const { return text.empty(); }
};

// A value of the JSON and how to name it: "animations[0].samplers[3].input". What is asked of a
// field that cannot answer is noted in the error, the first time, and answered with zero, an empty
// text or an empty field: whoever reads looks at the error where a loop or a function ends.
class Field {
 public:
  Field(const nlohmann::json& value, std::string path, FieldError& error)
      : value_(&value), path_(std::move(path)), error_(&error) {}
  // The same field, its errors elsewhere.
  Field with(FieldError& error) const { return {*value_, path_, error}; }

  bool ok() const { return error_->ok(); }
  void fail(const std::string& reason) const {
    if (ok()) error_->text = (path_.empty() ? "JSON" : path_) + ": " + reason;
  }
  bool has(const char* key) const { return is_object() && value_->contains(key); }
  bool is_object() const { return value_->is_object(); }
  bool is_array() const { return value_->is_array(); }
  Field operator[](const char* key) const;
  Field missing(const char* key) const;   // empty, called like a field of this one
  Field operator[](size_t index) const {  // index < size()
    return {(*value_)[index], path_ + "[" + std::to_string(index) + "]", *error_};
  }
  size_t size() const {
    if (!is_array()) fail("not an array");
    return is_array() ? value_->size() : 0;
  }
  // An element of a top-level array, by the index that this field holds.
  Field of(const Field& array) const;
  uint64_t count() const {
    if (value_->is_number_unsigned()) return value_->get<uint64_t>();
    fail("not a count");
    return 0;
  }
  uint64_t count_or(const char* key, uint64_t otherwise) const {
    return has(key) ? (*this)[key].count() : otherwise;
  }
  double number() const;
  std::string text() const { return gltf_excerpt(whole_text()); }
  const std::string& whole_text() const;
  bool flag_or_false(const char* key) const;
  template <size_t N>
  std::array<double, N> numbers() const {
    std::array<double, N> out{};
    if (size() != N) fail(std::to_string(size()) + " numbers, expected " + std::to_string(N));
    for (size_t i = 0; i < N && ok(); ++i) out[i] = (*this)[i].number();
    return out;
  }
  // Keys of an object and their fields.
  template <class F>
  void for_each(F use) const {
    if (!is_object()) return;
    for (const auto& [key, value] : value_->items())
      use(key, Field(value, path_ + "." + key, *error_));
  }

 private:
  const nlohmann::json* value_;
  std::string path_;
  FieldError* error_;
};

// Parses; more than 2^21 values or 64 levels are refused before anything is built. kCorrupt names
// `where`.
Result<nlohmann::json> parse_gltf_json(std::span<const std::byte> text, const std::string& where);

// "data:...;base64,..." as bytes; false if it is none.
bool decode_data_uri(const std::string& uri, std::vector<std::byte>& bytes);

}  // namespace figurine::ports
