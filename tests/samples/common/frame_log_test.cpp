#include "samples/common/frame_log.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace figurine::samples::frame_log_test {
namespace {

TEST(FrameLog, PercentilesAreByNearestRankAndMissedFramesAreCounted) {
  FrameLog log;
  EXPECT_EQ(log.total_ms().p99, 0);
  for (uint64_t ms = 200; ms >= 1; --ms) log.add({}, ms * 1'000'000);
  EXPECT_EQ(log.total_ms().median, 100.5);
  EXPECT_EQ(log.total_ms().p90, 180);
  EXPECT_EQ(log.total_ms().p99, 198);
  EXPECT_EQ(log.missed_60hz(), 184u) << "17 ms and more";
  EXPECT_EQ(log.stages_json().at("total").at("p99"), 198);
  FrameLog one;
  one.add({}, 5'000'000);
  EXPECT_EQ(one.total_ms().p99, 5);
  EXPECT_EQ(one.missed_60hz(), 0u);
}

}  // namespace
}  // namespace figurine::samples::frame_log_test
