#include "ports/vmc/osc.h"

#include <bit>
#include <cstring>

namespace figurine::ports {

namespace {

constexpr std::string_view kBundle("#bundle\0", 8);
constexpr size_t kTimeTagBytes = 8;

uint32_t word_at(std::span<const std::byte> bytes) {
  uint32_t word = 0;
  for (size_t i = 0; i < 4; ++i) word = word << 8 | std::to_integer<uint32_t>(bytes[i]);
  return word;
}

uint64_t long_at(std::span<const std::byte> bytes) {
  return uint64_t{word_at(bytes)} << 32 | word_at(bytes.subspan(4));
}

// Takes a string with its zeros, to the next multiple of four, off the front; false if it has no
// end. What stands behind the first zero is not looked at: senders leave there what was there.
bool take_string(std::span<const std::byte>& bytes, std::string_view& text) {
  const void* end = bytes.empty() ? nullptr : std::memchr(bytes.data(), 0, bytes.size());
  if (end == nullptr) return false;
  const auto length = static_cast<size_t>(static_cast<const std::byte*>(end) - bytes.data());
  const size_t padded = (length / 4 + 1) * 4;
  if (padded > bytes.size()) return false;
  text = {reinterpret_cast<const char*>(bytes.data()), length};
  bytes = bytes.subspan(padded);
  return true;
}

bool take_blob(std::span<const std::byte>& bytes, std::string_view& text) {
  if (bytes.size() < 4) return false;
  const size_t length = word_at(bytes), left = bytes.size() - 4;
  if (length > left || (length + 3) / 4 * 4 > left) return false;
  text = {reinterpret_cast<const char*>(bytes.data()) + 4, length};
  bytes = bytes.subspan(4 + (length + 3) / 4 * 4);
  return true;
}

// Takes the argument of a tag off the front; false if its bytes are not there, or the tag is none.
bool take_argument(char tag, std::span<const std::byte>& bytes, OscArgument& argument) {
  argument = {.tag = tag};
  switch (tag) {
    case 'T':
    case 'F':
    case 'N':
    case 'I':
    case '[':
    case ']':
      return true;
    case 's':
    case 'S':
      return take_string(bytes, argument.text);
    case 'b':
      return take_blob(bytes, argument.text);
    case 'i':
    case 'f':
    case 'c':
    case 'r':
    case 'm': {
      if (bytes.size() < 4) return false;
      const uint32_t word = word_at(bytes);
      argument.number = tag == 'f'   ? static_cast<double>(std::bit_cast<float>(word))
                        : tag == 'i' ? static_cast<double>(static_cast<int32_t>(word))
                                     : static_cast<double>(word);
      bytes = bytes.subspan(4);
      return true;
    }
    case 'h':
    case 'd':
    case 't': {
      if (bytes.size() < 8) return false;
      const uint64_t word = long_at(bytes);
      argument.number = tag == 'd'   ? std::bit_cast<double>(word)
                        : tag == 'h' ? static_cast<double>(static_cast<int64_t>(word))
                                     : static_cast<double>(word);
      bytes = bytes.subspan(8);
      return true;
    }
    default:
      return false;
  }
}

// Looks through a message; with a visitor, hands it on.
const char* walk_message(std::span<const std::byte> bytes, OscVisitor* visitor) {
  std::string_view address, tags;
  if (!take_string(bytes, address)) return "an address without end";
  // Old senders leave the tags out; a message without arguments is all that can be meant then.
  if (!bytes.empty()) {
    if (bytes[0] != std::byte{','}) return "no type tags";
    if (!take_string(bytes, tags)) return "type tags without end";
    tags.remove_prefix(1);
  }
  const std::span<const std::byte> data = bytes;
  OscArgument argument;
  for (const char tag : tags) {
    if (!take_argument(tag, bytes, argument)) return "an argument without its bytes";
  }
  if (!bytes.empty()) return "bytes behind the last argument";
  if (visitor != nullptr) visitor->message({address, tags, data});
  return nullptr;
}

const char* walk(std::span<const std::byte> bytes, int depth, OscVisitor* visitor) {
  if (bytes.empty() || bytes.size() % 4 != 0) return "a size that is no multiple of four";
  if (bytes[0] == std::byte{'/'}) return walk_message(bytes, visitor);
  if (bytes.size() < kBundle.size() + kTimeTagBytes ||
      std::memcmp(bytes.data(), kBundle.data(), kBundle.size()) != 0)
    return "neither a message nor a bundle";
  if (depth == 0) return "bundles too deep in bundles";
  bytes = bytes.subspan(kBundle.size() + kTimeTagBytes);
  while (!bytes.empty()) {
    if (bytes.size() < 4) return "a bundle that breaks off";
    const size_t size = word_at(bytes);
    bytes = bytes.subspan(4);
    if (size > bytes.size()) return "an element beyond its bundle";
    if (const char* wrong = walk(bytes.first(size), depth - 1, visitor)) return wrong;
    bytes = bytes.subspan(size);
  }
  return nullptr;
}

}  // namespace

bool OscMessage::next(OscArgument& argument) {
  if (tags_.empty()) return false;
  const char tag = tags_.front();
  tags_.remove_prefix(1);
  return take_argument(tag, data_, argument);
}

const char* read_osc(std::span<const std::byte> packet, OscVisitor& visitor) {
  if (const char* wrong = walk(packet, kOscDepth, nullptr)) return wrong;
  return walk(packet, kOscDepth, &visitor);
}

}  // namespace figurine::ports
