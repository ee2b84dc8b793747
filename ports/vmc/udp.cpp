#include "ports/vmc/udp.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>

namespace figurine::ports {

namespace {

constexpr size_t kMostBytes = 65536;  // more than a datagram of IPv4 holds
// A pose of 55 bones, a message a datagram, is 14 kB of the kernel's buffer; this is some seconds.
constexpr int kBufferBytes = 1 << 20;

std::string text_of(const UdpAddress& address) {
  return "vmc://" + address.host + ":" + std::to_string(address.port);
}

}  // namespace

Result<UdpAddress> parse_vmc_address(std::string_view text) {
  const auto invalid = [&](const std::string& why) {
    return Status(StatusCode::kInvalidArgument, "pose '" + std::string(text) + "': " + why);
  };
  constexpr std::string_view kScheme = "vmc://";
  if (!text.starts_with(kScheme)) return invalid("not vmc://[ADDRESS][:PORT]");
  std::string_view rest = text.substr(kScheme.size());
  if (rest.ends_with('/')) rest.remove_suffix(1);
  UdpAddress address;
  const size_t colon = rest.rfind(':');
  const std::string host(rest.substr(0, colon));
  if (colon != std::string_view::npos) {
    const std::string_view port = rest.substr(colon + 1);
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
    if (port.empty() || error != std::errc() || end != port.data() + port.size())
      return invalid("the port is no number from 0 to 65535");
  }
  if (host.empty()) return address;
  in_addr parsed{};
  if (host == "localhost") return address;
  if (::inet_pton(AF_INET, host.c_str(), &parsed) != 1)
    return invalid("the address is none of IPv4, such as 127.0.0.1, or 0.0.0.0 for everybody");
  address.host = host;
  return address;
}

Result<UdpReceiver> UdpReceiver::open(const UdpAddress& address) {
  UdpReceiver receiver;
  receiver.address_ = address;
  const auto failed = [&] {
    return Status(StatusCode::kIo, text_of(address) + ": cannot listen: " + std::strerror(errno));
  };
  receiver.descriptor_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (receiver.descriptor_ < 0) return failed();
  // As much as the system gives; less is no error.
  ::setsockopt(receiver.descriptor_, SOL_SOCKET, SO_RCVBUF, &kBufferBytes, sizeof(kBufferBytes));
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(address.port);
  if (::inet_pton(AF_INET, address.host.c_str(), &place.sin_addr) != 1) errno = EINVAL;
  if (place.sin_addr.s_addr == 0 && address.host != "0.0.0.0") return failed();
  socklen_t size = sizeof(place);
  if (::bind(receiver.descriptor_, reinterpret_cast<const sockaddr*>(&place), size) != 0 ||
      ::getsockname(receiver.descriptor_, reinterpret_cast<sockaddr*>(&place), &size) != 0)
    return failed();
  receiver.address_.port = ntohs(place.sin_port);
  receiver.buffer_.resize(kMostBytes);
  return receiver;
}

UdpReceiver::UdpReceiver(UdpReceiver&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      address_(std::move(other.address_)),
      buffer_(std::move(other.buffer_)) {}

UdpReceiver::~UdpReceiver() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<std::optional<std::span<const std::byte>>> UdpReceiver::receive(int timeout_ms) {
  using Datagram = std::optional<std::span<const std::byte>>;
  const auto failed = [&] {
    return Status(StatusCode::kIo, text_of(address_) + ": " + std::strerror(errno));
  };
  pollfd waiting{.fd = descriptor_, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, timeout_ms);
  if (ready < 0 && errno != EINTR) return failed();
  if (ready <= 0) return Datagram();
  const ssize_t count = ::recv(descriptor_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
  if (count < 0) {
    // The system found out that its checksum is wrong, or somebody else was quicker.
    if (errno == EAGAIN || errno == EINTR) return Datagram();
    return failed();
  }
  return Datagram(std::span<const std::byte>(buffer_).first(static_cast<size_t>(count)));
}

}  // namespace figurine::ports
