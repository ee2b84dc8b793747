// Reads OSC 1.0 packets: what VMC and many other senders of live values put into a datagram.
//
// Every packet is hostile. Nothing is allocated, nothing is read beyond the packet's end, a size
// that a packet states of itself is believed only where its bytes are there, and bundles in bundles
// end at kOscDepth. A packet is looked through whole before the first of its messages is handed on:
// it is taken as a whole or not at all. Time tags are read over: what comes is now.
//
// Based on: Wright, The Open Sound Control 1.0 Specification, 2002: big-endian, everything in
// multiples of four bytes; of the types that senders added since, those whose size is known.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace figurine::ports {

inline constexpr int kOscDepth = 8;  // bundles in bundles

struct OscArgument {
  // i h f d t c r m: number. s S b: text. T F N I: the tag says all.
  char tag = 0;
  double number = 0;
  std::string_view text;  // of a blob its bytes; points into the packet
};

// One message of a sound packet; points into it.
class OscMessage {
 public:
  OscMessage(std::string_view address, std::string_view tags, std::span<const std::byte> data)
      : address_(address), tags_(tags), data_(data) {}
  std::string_view address() const { return address_; }
  std::string_view tags() const { return tags_; }  // without the comma
  // The arguments in turn. False after the last one.
  bool next(OscArgument& argument);

 private:
  std::string_view address_, tags_;
  std::span<const std::byte> data_;  // not read yet
};

class OscVisitor {
 public:
  virtual void message(OscMessage message) = 0;

 protected:
  ~OscVisitor() = default;
};

// Hands on every message of a packet, in its order, if all of the packet is sound. Otherwise hands
// on none and returns what is wrong with it, in words; null: nothing.
const char* read_osc(std::span<const std::byte> packet, OscVisitor& visitor);

}  // namespace figurine::ports
