// bench at a steady rate: what it counts adds up, on the program.
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "runtime/test_packages.h"
#include "samples/program.h"

namespace figurine::tests::bench_test {
namespace {

using Json = nlohmann::json;

class Bench : public testing::Test {
 protected:
  Bench() { write_test_packages(folder_); }
  ProgramRun run(const std::string& arguments) {
    return run_figurine(arguments, {.folder = folder_.path()});
  }
  Json paced(const std::string& arguments) {
    const ProgramRun result = run("bench avatar.fgn --json - " + arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? Json::parse(result.out) : Json();
  }

  TestFolder folder_;
};

TEST_F(Bench, FramesBeginAtTicks) {
  const auto start = std::chrono::steady_clock::now();
  const Json json = paced("--size 32x32 --motion motion.fgn --hz 200 --frames 40 --threads 1");
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_GE(took_s, 40 / 200.0) << "a tick each";
  ASSERT_EQ(json["runs"].size(), 1u);
  const Json& counts = json["paced"];
  EXPECT_EQ(counts["hz"], 200.0);
  EXPECT_EQ(counts["frames"], 40);
  EXPECT_LE(counts["missed"], 40);
  // Who is late drops at least the tick that passed; nobody else drops any.
  EXPECT_GE(counts["dropped"], counts["missed"]);
  EXPECT_EQ(counts["dropped"] > 0, counts["missed"] > 0);
  const Json& latency = counts["latency_ms"];
  EXPECT_LE(latency["p50"], latency["p99"]);
  EXPECT_LE(latency["p99"], latency["worst"]);
  // Rounded to microseconds.
  if (counts["missed"] > 0) {
    EXPECT_GE(latency["worst"], 1000.0 / 200);
  } else {
    EXPECT_LE(latency["worst"], 1000.0 / 200);
  }
  EXPECT_LE(counts["wait_ms"]["worst"], latency["worst"]);
  EXPECT_GE(latency["worst"], json["runs"][0]["stages_ms"]["total"]["median"]);
}

// 6.5 million pixels are not written in a millisecond.
TEST_F(Bench, FramesThatCannotBeInTimeAreMissedAndNeverQueued) {
  const Json json = paced("--size 2560x2560 --hz 1000 --frames 6 --threads 1");
  EXPECT_EQ(json["paced"]["missed"], 6);
  EXPECT_GE(json["paced"]["dropped"], 6);
  // From its own tick: a queue would add up.
  EXPECT_LT(json["paced"]["wait_ms"]["p50"], json["paced"]["latency_ms"]["p50"]);
}

TEST_F(Bench, SharesOfARooflineStandBesideTheStages) {
  folder_.write("peak.json", R"({"command": "roofline", "rows": [{"threads": 1,
      "int8_macs_per_s": 1e12, "f32_macs_per_s": 1e11,
      "blend_operations_per_s": {"baseline": 1e10, "sse41": 1e10, "avx2": 2e10, "avx512": 4e10,
                                 "neon": 1e10},
      "memory_bytes_per_s": {"copy": 1e10}}]})");
  const Json json = paced("--size 64x64 --frames 3 --threads 1 --roofline peak.json");
  const Json& shares = json["runs"][0]["roofline"];
  for (const char* stage : {"network", "blend", "resolve"}) {
    ASSERT_TRUE(shares.contains(stage)) << stage;
    EXPECT_GT(shares[stage]["share"], 0.0);
  }
  const ProgramRun text =
      run("bench avatar.fgn --size 64x64 --frames 3 --threads 1 --roofline peak.json");
  EXPECT_NE(text.out.find("share of this machine's peak"), std::string::npos) << text.out;
  const ProgramRun none = run("bench avatar.fgn --frames 3 --roofline none.json --json b.json");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.err.find("none.json"), std::string::npos) << none.err;
  EXPECT_FALSE(folder_.has("b.json"));
}

TEST_F(Bench, SaysItInWordsAndRefusesARateThatIsNone) {
  const ProgramRun text = run("bench avatar.fgn --size 32x32 --hz 500 --frames 3 --threads 1");
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("paced at 500 Hz: "), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("of 3 frames missed their deadline"), std::string::npos) << text.out;
  for (const char* hz : {"0", "-1", "x", "1001"})
    EXPECT_EQ(run(std::string("bench avatar.fgn --hz ") + hz).exit_code, 2) << hz;
  const Json unpaced = paced("--size 32x32 --frames 2 --threads 1");
  EXPECT_FALSE(unpaced.contains("paced"));
}

}  // namespace
}  // namespace figurine::tests::bench_test
