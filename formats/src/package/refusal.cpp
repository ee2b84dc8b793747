#include "formats/src/package/refusal.h"

#include <charconv>

namespace figurine {

size_t Word::print(uint64_t value, char (&digits)[kDigits]) {
  return size_t(std::to_chars(digits, digits + kDigits, value).ptr - digits);
}
size_t Word::print(int64_t value, char (&digits)[kDigits]) {
  return size_t(std::to_chars(digits, digits + kDigits, value).ptr - digits);
}
size_t Word::print(double value, char (&digits)[kDigits]) {
  return size_t(std::to_chars(digits, digits + kDigits, value, std::chars_format::general, 7).ptr -
                digits);
}

std::string concatenate(std::initializer_list<Word> words) {
  std::string text;
  for (const Word& word : words) text += word.view();
  return text;
}

Status refuse(StatusCode code, std::string_view field, std::initializer_list<Word> reason) {
  std::string message(field);
  message += ": ";
  message += concatenate(reason);
  return Status(code, std::move(message));
}

}  // namespace figurine
