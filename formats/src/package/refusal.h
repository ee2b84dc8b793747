// How the reader says no: "field: reason" in one line. Out of line, so that a hundred reasons cost
// a device a few kilobytes rather than a hundred inlined string concatenations.
#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>

#include "figurine/status.h"

namespace figurine {

// A piece of a message: text (borrowed) or a number.
class Word {
 public:
  Word(std::string_view text) : text_(text) {}
  Word(const char* text) : text_(text) {}
  Word(const std::string& text) : text_(text) {}
  Word(std::unsigned_integral auto value) : size_(print(static_cast<uint64_t>(value), digits_)) {}
  Word(std::signed_integral auto value) : size_(print(static_cast<int64_t>(value), digits_)) {}
  Word(std::floating_point auto value) : size_(print(static_cast<double>(value), digits_)) {}

  std::string_view view() const { return size_ == 0 ? text_ : std::string_view(digits_, size_); }

 private:
  static constexpr size_t kDigits = 24;
  static size_t print(uint64_t value, char (&digits)[kDigits]);
  static size_t print(int64_t value, char (&digits)[kDigits]);
  static size_t print(double value, char (&digits)[kDigits]);

  std::string_view text_;
  size_t size_ = 0;  // of the digits; 0: a text
  char digits_[kDigits];
};

std::string concatenate(std::initializer_list<Word> words);

// "field: reason", the reason in pieces.
Status refuse(StatusCode code, std::string_view field, std::initializer_list<Word> reason);

template <class... Pieces>
Status corrupt(std::string_view field, const Pieces&... reason) {
  return refuse(StatusCode::kCorrupt, field, {Word(reason)...});
}

template <class... Pieces>
Status unsupported(std::string_view field, const Pieces&... reason) {
  return refuse(StatusCode::kUnsupported, field, {Word(reason)...});
}

template <class... Pieces>
Status over_limit(std::string_view field, const Pieces&... reason) {
  return refuse(StatusCode::kLimitExceeded, field, {Word(reason)...});
}

}  // namespace figurine
