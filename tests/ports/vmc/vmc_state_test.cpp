// What a sender says, and what it does not: every way of sending gives the same pose, what is no
// number is dropped and counted, silence is held and then eased, names from outside stay few.
#include "ports/vmc/vmc_state.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ports/vmc/smplx_figure.h"
#include "ports/vmc/vmc_sender.h"

namespace figurine::ports::vmc_state_test {
namespace {

using tests::OscWriter;
using tests::vmc_bone;
using tests::vmc_channel;

constexpr uint64_t kSecond = 1'000'000'000;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
const size_t kHead = *humanoid_bone("Head");

// A rotation of floats: what is sent comes back to the bit.
glm::dquat turned(double x) {
  const glm::dquat q = glm::normalize(glm::dquat(1, x, 0.5 * x, -x));
  return glm::dquat(float(q.w), float(q.x), float(q.y), float(q.z));
}

HumanoidPose some_pose() {
  HumanoidPose pose;
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    pose.local[b] = turned(0.02 * double(b));
    pose.offset_m[b] = {0.25 * double(b), -0.5, 0.125};
  }
  pose.root = turned(0.3);
  pose.root_m = {1, 0.5, -2};
  return pose;
}

void expect_pose(const HumanoidPose& got, const HumanoidPose& wanted) {
  for (size_t b = 0; b < kHumanoidBones; ++b) {
    EXPECT_GT(std::abs(glm::dot(got.local[b], wanted.local[b])), 1 - 1e-7) << b;
    EXPECT_EQ(got.offset_m[b], wanted.offset_m[b]) << b;
    EXPECT_TRUE(got.has_offset[b]);
  }
  EXPECT_EQ(got.root_m, wanted.root_m);
}

TEST(VmcState, EveryWayOfSendingGivesTheSamePose) {
  for (const size_t most_bytes : {size_t{0}, size_t{200}, size_t{1400}, size_t{60000}}) {
    VmcState state;
    for (const OscWriter& datagram : tests::vmc_datagrams(some_pose(), 1, most_bytes))
      state.receive(datagram.packet(), 5);
    expect_pose(state.pose(), some_pose());
    EXPECT_EQ(state.counts().poses, kHumanoidBones + 1);
    EXPECT_EQ(state.counts().malformed, 0u);
    EXPECT_EQ(state.counts().dropped + state.counts().unknown, 0u);
    EXPECT_EQ(state.newest_ns(), 5u);
  }
}

TEST(VmcState, RootsOfLaterVersionsBringMore) {
  OscWriter writer;
  writer.message("/VMC/Ext/Root/Pos", "sfffffffffffff").text("root");
  for (const float v : {1.f, 2.f, 3.f, 0.f, 0.f, 0.f, 1.f, 1.f, 1.f, 1.f, 0.f, 0.f, 0.f})
    writer.real(v);
  VmcState state;
  state.receive(writer.packet(), 0);
  EXPECT_EQ(state.pose().root_m, glm::dvec3(-1, 2, 3)) << "Unity's x is ours turned around";
}

TEST(VmcState, WhatIsNoRotationIsDroppedAndCounted) {
  VmcState state;
  state.receive(vmc_bone("Head", turned(0.4)).packet(), 1);
  uint64_t dropped = 0;
  const auto refuse = [&](const glm::dquat& q, const glm::dvec3& place) {
    state.receive(vmc_bone("Head", q, place).packet(), 2);
    EXPECT_EQ(state.counts().dropped, ++dropped);
  };
  for (const double bad : {double(kNan), double(kInfinity), -double(kInfinity)}) {
    refuse({bad, 0, 0, 0}, {0, 0, 0});
    refuse({1, bad, 0, 0}, {0, 0, 0});
    refuse({1, 0, 0, 0}, {0, bad, 0});
  }
  refuse({0, 0, 0, 0}, {0, 0, 0});
  refuse({1e-9, 0, 0, 0}, {0, 0, 0});
  refuse({1e30, 1e30, 0, 0}, {0, 0, 0});
  refuse({1, 0, 0, 0}, {2000, 0, 0});
  EXPECT_GT(glm::dot(state.pose().local[kHead], turned(0.4)), 1 - 1e-7) << "the one before stays";
  EXPECT_EQ(state.newest_ns(), 1u) << "and nothing new has come";
}

TEST(VmcState, OtherMessagesDoNoHarm) {
  VmcState state;
  state.receive(vmc_bone("Tail", turned(1)).packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/Bone/Pos", "").packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/Bone/Pos", "i").word(3).packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/Bone/Pos", "sf").text("Head").real(1).packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/Root/Pos", "T").packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/Blend/Val", "f").real(1).packet(), 1);
  EXPECT_EQ(state.counts().unknown, 6u);
  state.receive(OscWriter().message("/other/program", "i").word(3).packet(), 1);
  state.receive(OscWriter().message("/VMC/Ext/T", "").packet(), 1);
  state.receive(std::as_bytes(std::span("abc", 3)), 1);
  state.receive({}, 1);
  EXPECT_EQ(state.counts().malformed, 2u);
  EXPECT_EQ(state.counts().poses, 0u);
  EXPECT_EQ(state.newest_ns(), std::nullopt);
}

TEST(VmcState, ASilentSenderIsHeldThenLetGo) {
  VmcState state({.hold_s = 1, .ease_s = 2});
  EXPECT_EQ(state.presence(7), 0) << "nobody has spoken";
  state.receive(vmc_bone("Head", turned(0.4)).packet(), 10 * kSecond);
  EXPECT_EQ(state.presence(10 * kSecond), 1);
  EXPECT_EQ(state.presence(11 * kSecond), 1);
  EXPECT_NEAR(state.presence(12 * kSecond), 0.5, 1e-9);
  EXPECT_EQ(state.presence(13 * kSecond), 0);
  EXPECT_EQ(state.presence(UINT64_MAX), 0);
  double before = 1;
  for (uint64_t ms = 1000; ms <= 3100; ms += 10) {
    const double now = state.presence(10 * kSecond + ms * 1'000'000);
    EXPECT_LE(now, before);
    EXPECT_GT(now, before - 0.01) << "no jump";
    before = now;
  }
  state.receive(vmc_bone("Head", turned(0.4)).packet(), 20 * kSecond);
  EXPECT_EQ(state.presence(20 * kSecond), 1) << "back again";
  // A clock that goes back: the packet is newer than now.
  EXPECT_EQ(state.presence(3 * kSecond), 1);
}

TEST(VmcState, EasingTurnsByTheShorterArcAndEndsAtRest) {
  for (const float sign : {1.0f, -1.0f}) {
    const float s = std::sqrt(0.5f);
    std::vector<float> q = {sign * s, sign * s, 0, 0};  // a quarter turn about x, both ways said
    std::array<float, 3> root{1, 2, 3};
    ease_to_rest(1, q, root);
    EXPECT_EQ(q, (std::vector<float>{sign * s, sign * s, 0, 0}));
    ease_to_rest(0.5, q, root);
    EXPECT_NEAR(2 * std::atan2(std::abs(q[1]), std::abs(q[0])), 3.14159265 / 4, 1e-6);
    EXPECT_EQ(root, (std::array<float, 3>{0.5f, 1, 1.5f}));
    ease_to_rest(0, q, root);
    EXPECT_EQ(q, (std::vector<float>{1, 0, 0, 0}));
    EXPECT_EQ(root, (std::array<float, 3>{0, 0, 0}));
  }
}

TEST(VmcState, ChannelsAreListedOnceAndAreFew) {
  VmcState state;
  for (const char* name : {"Joy", "A", "Joy", "A"}) state.receive(vmc_channel(name, 1).packet(), 1);
  EXPECT_EQ(state.new_channels(), (std::vector<std::string>{"Joy", "A"}));
  EXPECT_TRUE(state.new_channels().empty());
  state.receive(vmc_channel("\x1b[2J\xff", 1).packet(), 1);
  EXPECT_EQ(state.new_channels(), std::vector<std::string>{"?[2J?"});
  for (int i = 0; i < 10000; ++i)
    state.receive(vmc_channel("channel " + std::to_string(i), 1).packet(), 1);
  EXPECT_EQ(state.channel_count(), VmcState::kMostChannels);
  EXPECT_EQ(state.new_channels().size(), VmcState::kMostChannels - 3);
  state.receive(vmc_channel(std::string(5000, 'x'), 1).packet(), 1);
  EXPECT_EQ(state.counts().poses, 0u);
}

TEST(VmcState, TheSendersClockChangesNothing) {
  VmcState state;
  for (const float time : {5.0f, 6.0f, 2.0f, kNan, -1e30f, 7.0f}) {
    state.receive(OscWriter().message("/VMC/Ext/T", "f").real(time).packet(), 1);
    state.receive(vmc_bone("Head", turned(time == 2.0f ? 0.2 : 0.4)).packet(), 1);
  }
  EXPECT_GE(state.counts().time_back, 1u);
  EXPECT_EQ(state.counts().poses, 6u);
  EXPECT_GT(glm::dot(state.pose().local[kHead], turned(0.4)), 1 - 1e-7);
}

}  // namespace
}  // namespace figurine::ports::vmc_state_test
