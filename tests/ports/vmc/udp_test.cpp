// Addresses as people write them, and datagrams over the loopback.
#include "ports/vmc/udp.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace figurine::ports::udp_test {
namespace {

TEST(VmcAddress, IsLoopbackUnlessToldOtherwise) {
  const auto expect = [](const char* text, const std::string& host, uint16_t port) {
    const Result<UdpAddress> address = parse_vmc_address(text);
    ASSERT_TRUE(address.ok()) << address.status().message();
    EXPECT_EQ(address->host, host) << text;
    EXPECT_EQ(address->port, port) << text;
  };
  expect("vmc://:39539", "127.0.0.1", 39539);
  expect("vmc://", "127.0.0.1", 39539);
  expect("vmc://:4000", "127.0.0.1", 4000);
  expect("vmc://localhost:4000/", "127.0.0.1", 4000);
  expect("vmc://0.0.0.0:39539", "0.0.0.0", 39539);
  expect("vmc://192.168.1.7", "192.168.1.7", 39539);
  expect("vmc://:0", "127.0.0.1", 0);
}

TEST(VmcAddress, OtherTextIsRefused) {
  for (const char* text : {"", "vmc", "vmc:39539", "udp://:1", "vmc://:", "vmc://:65536",
                           "vmc://:-1", "vmc://:1x", "vmc://: 1", "vmc://name.of.a.host:1",
                           "vmc://1.2.3:1", "vmc://[::1]:1", "vmc://1.2.3.4.5:6"}) {
    const Result<UdpAddress> address = parse_vmc_address(text);
    EXPECT_FALSE(address.ok()) << text;
    if (address.ok()) continue;
    EXPECT_EQ(address.status().message().rfind("pose '" + std::string(text) + "': ", 0), 0u);
  }
}

struct Sender {
  int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ~Sender() { ::close(descriptor); }
  void send(const UdpAddress& to, const std::string& bytes) const {
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_port = htons(to.port);
    ::inet_pton(AF_INET, "127.0.0.1", &place.sin_addr);
    ASSERT_EQ(::sendto(descriptor, bytes.data(), bytes.size(), 0,
                       reinterpret_cast<const sockaddr*>(&place), sizeof(place)),
              static_cast<ssize_t>(bytes.size()));
  }
};

TEST(UdpReceiver, GivesDatagramsAsTheyCame) {
  Result<UdpReceiver> receiver = UdpReceiver::open({.port = 0});
  ASSERT_TRUE(receiver.ok()) << receiver.status().message();
  EXPECT_NE(receiver->address().port, 0);
  const Sender sender;
  for (const std::string& bytes : {std::string("abcd"), std::string(), std::string(60000, 'x')}) {
    sender.send(receiver->address(), bytes);
    const auto got = receiver->receive(5000);
    ASSERT_TRUE(got.ok()) << got.status().message();
    ASSERT_TRUE(got.value().has_value());
    const std::span<const std::byte> datagram = **got;
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(datagram.data()), datagram.size()), bytes);
  }
  const auto none = receiver->receive(1);
  ASSERT_TRUE(none.ok());
  EXPECT_FALSE(none.value().has_value());
}

TEST(UdpReceiver, SaysWhyItCannotListen) {
  const Result<UdpReceiver> first = UdpReceiver::open({.port = 0});
  ASSERT_TRUE(first.ok());
  const Result<UdpReceiver> second = UdpReceiver::open(first.value().address());
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.status().message(),
            "vmc://127.0.0.1:" + std::to_string(first.value().address().port) +
                ": cannot listen: Address already in use");
  const Result<UdpReceiver> elsewhere = UdpReceiver::open({.host = "192.0.2.1", .port = 0});
  ASSERT_FALSE(elsewhere.ok()) << "an address of nobody (RFC 5737)";
  EXPECT_NE(elsewhere.status().message().find("vmc://192.0.2.1:0: cannot listen"),
            std::string::npos);
}

}  // namespace
}  // namespace figurine::ports::udp_test
