// Shares of a roofline by hand, and files that are none.
#include "samples/figurine/roofline.h"

#include <gtest/gtest.h>

namespace figurine::samples::roofline_test {
namespace {

using Json = nlohmann::ordered_json;

Json sound_file() {
  return Json::parse(R"({"command": "roofline", "machine": {"cpu": "a CPU"}, "rows": [
      {"threads": 1, "int8_macs_per_s": 1e11, "f32_macs_per_s": 2e10,
       "blend_operations_per_s": {"avx2": 4.3e10}, "memory_bytes_per_s": {"copy": 1e10}}]})");
}

Json run_of(const char* precision) {
  Json stages;
  for (size_t s = 0; s < kStageCount; ++s)
    stages[to_string(static_cast<Stage>(s))] = {{"median", 0.0}};
  stages["network"]["median"] = 2.0;
  stages["blend"]["median"] = 4.0;
  stages["resolve"]["median"] = 0.5;
  return {{"threads", 1},
          {"precision", precision},
          {"stages_ms", stages},
          {"work", {{"macs", 100e6}, {"blends", 1e6}, {"visible", 1000}, {"pairs", 5000}}}};
}

TEST(Roofline, SharesAreWorkOverTimeOverThePeak) {
  const auto roofline = Roofline::parse(sound_file().dump(), "peak.json");
  ASSERT_TRUE(roofline.ok()) << roofline.status().message();
  EXPECT_EQ(roofline->cpu(), "a CPU");
  const auto shares = roofline->shares(run_of("q8"), "avx2", {.pixels = 100'000});
  ASSERT_TRUE(shares.ok()) << shares.status().message();
  // 100 M in 2 ms are 5e10 a second of 1e11.
  EXPECT_DOUBLE_EQ((*shares)["network"]["share"], 0.5);
  // 1 M contributions of 43 operations in 4 ms are 1.075e10 of 4.3e10.
  EXPECT_DOUBLE_EQ((*shares)["blend"]["share"], 0.25);
  // 100,000 pixels of 4 bytes in 0.5 ms are 8e8 of 1e10.
  EXPECT_DOUBLE_EQ((*shares)["resolve"]["share"], 0.08);
  EXPECT_FALSE(shares->contains("sort")) << "took no time";
  const auto floats = roofline->shares(run_of("f32"), "avx2", {});
  EXPECT_DOUBLE_EQ((*floats)["network"]["share"], 1e4 * 5 / 2e4);
  EXPECT_EQ((*floats)["network"]["of"], "float MACs");
}

TEST(Roofline, EveryStageComputesOrMovesBytes) {
  const SceneSize size{.texels = 10, .cells = 5, .head_values = 140, .pixels = 64};
  for (size_t s = 0; s < kStageCount; ++s) {
    const Stage stage = static_cast<Stage>(s);
    const bool computes = stage == Stage::kNetwork || stage == Stage::kBlend;
    EXPECT_EQ(stage_bytes(stage, size, 8, 20) == 0, computes) << to_string(stage);
  }
  EXPECT_EQ(stage_bytes(Stage::kResolve, size, 8, 20), 64u * 4);
  EXPECT_EQ(stage_bytes(Stage::kSkin, size, 8, 20), 10u * 64);
}

TEST(Roofline, RefusesWhatIsNotTheProgramsFileAndNamesTheField) {
  const auto expect_refused = [](const std::string& text, const std::string& words) {
    const Status status = Roofline::parse(text, "peak.json").status();
    EXPECT_FALSE(status.ok()) << text;
    EXPECT_EQ(status.message().rfind("peak.json: ", 0), 0u) << status.message();
    EXPECT_NE(status.message().find(words), std::string::npos) << status.message();
    EXPECT_EQ(status.message().find('\n'), std::string::npos);
  };
  expect_refused("", "is not JSON");
  expect_refused("[1]", "is not JSON");
  expect_refused("{}", "command");
  const std::string sound = sound_file().dump();
  for (size_t length = 1; length < sound.size(); length += 7)
    expect_refused(sound.substr(0, length), "roofline: is not JSON");
  const auto bent = [](const auto& bend) {
    Json json = sound_file();
    bend(json);
    return json.dump();
  };
  expect_refused(bent([](Json& j) { j["rows"] = Json::array(); }), "rows: are not there");
  expect_refused(bent([](Json& j) { j["rows"][0] = 1; }), "rows[0]: is not an object");
  expect_refused(bent([](Json& j) { j["rows"][0].erase("threads"); }), "rows[0].threads");
  expect_refused(bent([](Json& j) { j["rows"][0]["threads"] = -1; }), "rows[0].threads");
  expect_refused(bent([](Json& j) { j["rows"][0]["int8_macs_per_s"] = 0; }), "int8_macs_per_s");
  expect_refused(bent([](Json& j) { j["rows"][0]["f32_macs_per_s"] = "x"; }), "f32_macs_per_s");
  expect_refused(bent([](Json& j) { j["rows"][0]["memory_bytes_per_s"] = 3; }), "memory_bytes");
  expect_refused(bent([](Json& j) { j["rows"][0]["blend_operations_per_s"]["avx2"] = nullptr; }),
                 "blend_operations_per_s.avx2");
  const auto roofline = Roofline::parse(sound, "peak.json");
  EXPECT_EQ(roofline->shares(run_of("q8"), "avx512", {}).status().code(), StatusCode::kNotFound);
  Json two = run_of("q8");
  two["threads"] = 2;
  EXPECT_EQ(roofline->shares(two, "avx2", {}).status().message(),
            "peak.json: rows: none of 2 threads");
  EXPECT_EQ(Roofline::load("/nowhere/peak.json").status().code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace figurine::samples::roofline_test
