// Datagrams from a port of this machine. IPv4; bound to the loopback address unless told otherwise,
// so that nobody else's network can move a figure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/status.h"

namespace figurine::ports {

inline constexpr uint16_t kVmcPort = 39539;  // of performers, by the protocol

struct UdpAddress {
  std::string host = "127.0.0.1";  // dotted numbers
  uint16_t port = kVmcPort;        // 0: one that the system chooses
};

// "vmc://:39539" (loopback), "vmc://0.0.0.0:39539" (everybody), "vmc://" (loopback, the protocol's
// port). kInvalidArgument for anything else.
Result<UdpAddress> parse_vmc_address(std::string_view text);

class UdpReceiver {
 public:
  // kIo, naming the address: the port is taken, or the address is none of this machine's.
  static Result<UdpReceiver> open(const UdpAddress& address);
  UdpReceiver(UdpReceiver&& other) noexcept;
  UdpReceiver& operator=(UdpReceiver&&) = delete;
  ~UdpReceiver();

  // The address that it is bound to, with the port that the system chose.
  const UdpAddress& address() const { return address_; }
  // Waits until a datagram comes, at most timeout_ms; none: none came. Valid until the next call.
  // What is longer than a datagram can be does not exist; nothing is cut off.
  Result<std::optional<std::span<const std::byte>>> receive(int timeout_ms);

 private:
  UdpReceiver() = default;
  int descriptor_ = -1;
  UdpAddress address_;
  std::vector<std::byte> buffer_;
};

}  // namespace figurine::ports
