// Deadlines by hand: frames in time, one that is late, one that is late by many ticks, and a rate
// whose period is no whole number of nanoseconds.
#include "samples/common/deadlines.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace figurine::samples::deadlines_test {
namespace {

constexpr uint64_t kMs = 1'000'000, kStart = 5'000 * kMs;

TEST(Deadlines, AFrameIsDueByTheNextTick) {
  Deadlines paced(100, kStart);  // a tick every 10 ms
  EXPECT_EQ(paced.tick_ns(), kStart + 10 * kMs);
  EXPECT_EQ(paced.deadline_ns(), kStart + 20 * kMs);
  paced.add(kStart + 11 * kMs, kStart + 14 * kMs);
  paced.add(kStart + 20 * kMs, kStart + 30 * kMs);  // at its deadline to the nanosecond
  EXPECT_EQ(paced.missed(), 0u);
  EXPECT_EQ(paced.dropped(), 0u);
  EXPECT_EQ(paced.tick_ns(), kStart + 30 * kMs);
  const auto json = paced.json();
  EXPECT_EQ(json["frames"], 2);
  EXPECT_EQ(json["latency_ms"]["p50"], 4.0);
  EXPECT_EQ(json["latency_ms"]["worst"], 10.0);
  EXPECT_EQ(json["wait_ms"]["worst"], 1.0);
}

TEST(Deadlines, ALateFrameDropsTheTicksThatItTookAndIsNotCaughtUpWith) {
  Deadlines paced(100, kStart);
  paced.add(kStart + 10 * kMs, kStart + 20 * kMs + 1);  // a nanosecond late
  EXPECT_EQ(paced.missed(), 1u);
  EXPECT_EQ(paced.dropped(), 1u) << "the tick at 20 ms had passed";
  EXPECT_EQ(paced.tick_ns(), kStart + 30 * kMs);
  paced.add(kStart + 30 * kMs, kStart + 85 * kMs);
  EXPECT_EQ(paced.missed(), 2u) << "one frame, however late";
  EXPECT_EQ(paced.dropped(), 1u + 5u);
  EXPECT_EQ(paced.tick_ns(), kStart + 90 * kMs);
  paced.add(kStart + 90 * kMs, kStart + 91 * kMs);
  EXPECT_EQ(paced.missed(), 2u);
  EXPECT_EQ(paced.frames(), 3u);
  // Every tick has a frame, or is dropped.
  EXPECT_EQ(paced.tick_ns(), kStart + (paced.frames() + paced.dropped() + 1) * 10 * kMs);
}

TEST(Deadlines, TicksDoNotDrift) {
  for (const double hz : {60.0, 59.94, 30.0, 90.0, 7.0}) {
    Deadlines paced(hz, kStart);
    for (int i = 0; i < 10000; ++i) paced.add(paced.tick_ns(), paced.tick_ns() + 1000);
    EXPECT_EQ(paced.dropped(), 0u) << hz;
    EXPECT_NEAR(static_cast<double>(paced.tick_ns() - kStart), 10001 * 1e9 / hz, 1) << hz;
  }
}

TEST(Deadlines, PercentilesAreByNearestRank) {
  Deadlines paced(100, 0);
  for (uint64_t i = 1; i <= 100; ++i) {
    const uint64_t tick = paced.tick_ns();
    paced.add(tick, tick + i * kMs / 20);
  }
  const auto latency = paced.json()["latency_ms"];
  EXPECT_EQ(latency["p50"], 2.5);
  EXPECT_EQ(latency["p99"], 4.95);
  EXPECT_EQ(latency["worst"], 5.0);
  EXPECT_TRUE(Deadlines(60, 0).json()["latency_ms"].is_null());
}

}  // namespace
}  // namespace figurine::samples::deadlines_test
