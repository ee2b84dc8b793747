// Writes OSC packets for tests: sound ones, and, through bytes(), any others.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace figurine::tests {

class OscWriter {
 public:
  // A message; arguments follow in the order of the tags.
  OscWriter& message(std::string_view address, std::string_view tags) {
    return text(address).text("," + std::string(tags));
  }
  OscWriter& text(std::string_view s) {
    bytes_ += s;
    bytes_.append(4 - s.size() % 4, '\0');
    return *this;
  }
  OscWriter& blob(std::string_view s) {
    word(static_cast<uint32_t>(s.size())).bytes_ += s;
    bytes_.append((4 - s.size() % 4) % 4, '\0');
    return *this;
  }
  OscWriter& word(uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes_ += static_cast<char>(value >> shift & 255);
    return *this;
  }
  OscWriter& real(float value) { return word(std::bit_cast<uint32_t>(value)); }
  OscWriter& long_word(uint64_t value) {
    return word(static_cast<uint32_t>(value >> 32)).word(static_cast<uint32_t>(value));
  }
  // A bundle begins; elements follow.
  OscWriter& bundle() {
    bytes_ += std::string_view("#bundle\0", 8);
    return long_word(1);  // now
  }
  OscWriter& element(const OscWriter& inner) {
    word(static_cast<uint32_t>(inner.bytes_.size())).bytes_ += inner.bytes_;
    return *this;
  }

  std::string& bytes() { return bytes_; }
  size_t size() const { return bytes_.size(); }
  std::span<const std::byte> packet() const { return std::as_bytes(std::span(bytes_)); }

 private:
  std::string bytes_;
};

}  // namespace figurine::tests
