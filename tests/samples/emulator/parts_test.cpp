// The emulator's small parts, each by itself: the timeline, the camera under a hand, the switches,
// the estimates of devices, the way back to people, scripts.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>

#include "samples/emulator/device_profile.h"
#include "samples/emulator/orbit_view.h"
#include "samples/emulator/people.h"
#include "samples/emulator/script.h"
#include "samples/emulator/switches.h"
#include "samples/emulator/timeline.h"

namespace figurine::emulator::parts_test {
namespace {

TEST(Timeline, PlaysRoundAndRound) {
  Timeline timeline;
  timeline.set_length(60, 30);
  timeline.advance(0.5);
  EXPECT_EQ(timeline.frame(), 15u);
  timeline.advance(1.75);
  EXPECT_NEAR(timeline.time_s(), 0.25, 1e-9);
  timeline.set_speed(2);
  timeline.advance(0.25);
  EXPECT_NEAR(timeline.time_s(), 0.75, 1e-9);
  timeline.set_playing(false);
  timeline.advance(10);
  EXPECT_NEAR(timeline.time_s(), 0.75, 1e-9);
  timeline.set_playing(true);
  timeline.advance(-1);
  EXPECT_NEAR(timeline.time_s(), 0.75, 1e-9) << "a clock that goes back moves nothing";
}

TEST(Timeline, SeeksWithinTheMotion) {
  Timeline timeline;
  timeline.set_length(60, 30);
  timeline.seek(5);
  EXPECT_EQ(timeline.frame(), 59u);
  timeline.seek(-1);
  EXPECT_EQ(timeline.frame(), 0u);
  timeline.seek(std::nan(""));
  EXPECT_EQ(timeline.frame(), 0u);
  timeline.seek(1.5);
  timeline.set_length(10, 30);
  EXPECT_EQ(timeline.frame(), 9u) << "a shorter motion ends sooner";
  timeline.set_length(1, 30);
  timeline.advance(3);
  EXPECT_EQ(timeline.frame(), 0u) << "one frame does not move";
  timeline.set_speed(1e9);
  EXPECT_EQ(timeline.speed(), Timeline::kFastest);
}

TEST(OrbitView, TurnsWithTheHand) {
  OrbitView view;
  view.set({.azimuth_deg = 10, .elevation_deg = 5, .distance_m = 3});
  view.turn(40, 20);
  EXPECT_NEAR(view.orbit().azimuth_deg, 0, 1e-4);
  EXPECT_NEAR(view.orbit().elevation_deg, 10, 1e-4);
  view.turn(0, 1e6);
  EXPECT_LE(view.orbit().elevation_deg, 90);
  EXPECT_TRUE(view.camera({0, 0, 0}, {64, 48}).ok()) << "straight from above";
  view.turn(720 * 40, 0);
  EXPECT_LE(std::abs(view.orbit().azimuth_deg), 180) << "stays a small number";
}

TEST(OrbitView, ZoomsBetweenBounds) {
  OrbitView view;
  view.set({.distance_m = 3});
  view.zoom(1);
  EXPECT_NEAR(view.orbit().distance_m, 2.7f, 1e-5);
  view.zoom(-1);
  EXPECT_NEAR(view.orbit().distance_m, 3, 1e-5);
  for (int i = 0; i < 200; ++i) view.zoom(50);
  EXPECT_EQ(view.orbit().distance_m, OrbitView::kNearest_m);
  EXPECT_TRUE(view.camera({0, 0, 0}, {64, 48}).ok());
  for (int i = 0; i < 200; ++i) view.zoom(-50);
  EXPECT_EQ(view.orbit().distance_m, OrbitView::kFarthest_m);
}

// What the hand takes hold of stays under it: a point at the target's depth moves by as many
// pixels.
TEST(OrbitView, ShiftsWhatIsSeenWithTheHand) {
  for (const float azimuth : {0.0f, 70.0f, -150.0f}) {
    OrbitView view;
    view.set(
        {.azimuth_deg = azimuth, .elevation_deg = 30, .distance_m = 3, .vertical_fov_deg = 40});
    view.shift(24, -10, 480);
    const Camera camera = *view.camera({1, 2, 3}, {640, 480});
    const auto& m = camera.view_from_world;
    // The place that was in the middle before.
    const double p[3] = {1, 2, 3};
    double q[3];
    for (int r = 0; r < 3; ++r)
      q[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    EXPECT_NEAR(camera.fx_px * q[0] / q[2] + camera.cx_px, 320 + 24, 0.1) << azimuth;
    EXPECT_NEAR(camera.fy_px * q[1] / q[2] + camera.cy_px, 240 - 10, 0.1) << azimuth;
  }
}

TEST(Switches, KnowEveryFieldThatAFrameHas) {
  // A new member makes one of these bigger, and wants a row in the table.
  struct {
    bool a, b, c, d, e, f;
  } leave_out;
  EXPECT_EQ(sizeof(LeaveOut), sizeof(leave_out));
  EXPECT_EQ(sizeof(Approximation), 6 * sizeof(float));
  for (const Switch& each : switches()) {
    Settings settings = dense_settings();
    EXPECT_FALSE(each.on(settings)) << each.name;
    each.set(settings, each.tried);
    EXPECT_TRUE(each.on(settings)) << each.name;
    EXPECT_FALSE(settings == dense_settings()) << each.name;
    each.set(settings, each.off);
    EXPECT_TRUE(settings == dense_settings()) << each.name;
    EXPECT_EQ(find_switch(each.name), &each) << "names are different";
  }
  const LeaveOut none = dense_settings().leave_out;
  EXPECT_FALSE(none.hidden_texels || none.transparent || none.outside || none.missed_tiles ||
               none.stopped || none.unchanged_networks);
}

TEST(Switches, AreSetByNameWithinTheirRange) {
  Settings settings;
  ASSERT_TRUE(set_switch(settings, "hidden-texels", "off").ok());
  EXPECT_FALSE(settings.leave_out.hidden_texels);
  ASSERT_TRUE(set_switch(settings, "averted-above", "0.25").ok());
  EXPECT_EQ(settings.approximation.averted_above, 0.25f);
  ASSERT_TRUE(set_switch(settings, "network-interval", "on").ok());
  EXPECT_EQ(settings.approximation.network_interval, 2u);
  const auto refused = [&](const char* name, const char* value, const char* reason) {
    const Status status = set_switch(settings, name, value);
    EXPECT_NE(status.message().find(reason), std::string::npos) << status.message();
  };
  refused("averted", "on", "is none of hidden-texels, ");
  refused("fast-blend", "0.5", "is neither on nor off");
  refused("averted-above", "1.5", "nor a number from 0 to 1");
  refused("averted-above", "nan", "nor a number");
  refused("network-interval", "", "nor a number");
}

// The numbers in the program are those of the file, and the frame that was counted is estimated as
// the file has it.
TEST(DeviceProfile, EstimatesAreWhatWasCounted) {
  std::ifstream file(FIGURINE_SOURCE_DIR "/docs/results/arm_instructions.json");
  const auto json = nlohmann::json::parse(file);
  for (const auto& [core, name, summary] : {std::tuple(Core::kA76, "cortex-a76", "arm_a76_fps"),
                                            std::tuple(Core::kA53, "cortex-a53", "arm_a53_fps")}) {
    const auto& measured = json["cores"][name];
    const auto& exact = measured["tiers"]["exact"];
    const auto& fast = measured["tiers"]["fast"];
    const CountedFrame& counted = counted_frame(core);
    for (size_t i = 0; i < kStageCount; ++i) {
      EXPECT_EQ(counted.instructions[i],
                exact["stages"][to_string(static_cast<Stage>(i))]["instructions"].get<double>());
    }
    EXPECT_EQ(counted.fast_blend, fast["stages"]["blend"]["instructions"].get<double>());
    const auto& work = exact["work"];
    const CountedWork& known = counted_work();
    EXPECT_EQ(known.gaussians, work["gaussians"].get<double>());
    EXPECT_EQ(known.visible, work["visible"].get<double>());
    EXPECT_EQ(known.pairs, work["pairs"].get<double>());
    EXPECT_EQ(known.blends, work["blends"].get<double>());
    EXPECT_EQ(known.macs, work["macs"].get<double>());
    EXPECT_EQ(known.fast_blends, fast["work"]["blends"].get<double>());
    FrameStatistics same;
    same.gaussians = work["gaussians"], same.visible = work["visible"];
    same.pairs = work["pairs"], same.blends = work["blends"], same.macs = work["macs"];
    int profiles = 0;
    for (const DeviceProfile& profile : device_profiles()) {
      if (profile.core != core) continue;
      ++profiles;
      EXPECT_EQ(profile.ghz, measured["ghz"].get<double>());
      EXPECT_EQ(profile.instructions_per_cycle, measured["instructions_per_cycle"].get<double>());
      const auto estimate = estimate_frame(profile, same, 512 * 512, false);
      ASSERT_TRUE(estimate);
      const double wanted_ms = 1000 / json["summary"][summary].get<double>();
      // Besides the stages a frame has 0.04 % of other instructions.
      EXPECT_NEAR(estimate->total_ms, wanted_ms, 1e-3 * wanted_ms);
      same.blends = fast["work"]["blends"];
      const double fast_ms = 1000 / json["summary"][std::string(summary) + "_fast"].get<double>();
      EXPECT_NEAR(estimate_frame(profile, same, 512 * 512, true)->total_ms, fast_ms,
                  1e-3 * fast_ms);
      same.blends = work["blends"];
    }
    EXPECT_GE(profiles, 1);
  }
}

TEST(DeviceProfile, AStageGoesWithItsWork) {
  const DeviceProfile& board = *find_profile("a53-board");
  FrameStatistics work;
  work.gaussians = 8000, work.visible = 8000, work.pairs = 20000, work.blends = 1000000;
  work.macs = 240000000;
  const FrameEstimate one = *estimate_frame(board, work, 100000, false);
  FrameStatistics more = work;
  more.blends *= 2;
  const FrameEstimate two = *estimate_frame(board, more, 100000, false);
  const auto blend = static_cast<size_t>(Stage::kBlend);
  EXPECT_NEAR(two.stage_ms[blend], 2 * one.stage_ms[blend], 1e-9);
  EXPECT_NEAR(two.total_ms - one.total_ms, one.stage_ms[blend], 1e-9);
  more = work, more.macs = 0;
  EXPECT_EQ(estimate_frame(board, more, 100000, false)->stage_ms[size_t(Stage::kNetwork)], 0)
      << "a network that did not run takes no time";
  EXPECT_FALSE(estimate_frame(*find_profile("desk"), work, 100000, false)) << "is measured";
  EXPECT_EQ(find_profile("toaster"), nullptr);
}

Person person_of(uint64_t seed) {
  Person person{.seed = {.seed = seed}};
  person.avatar = std::make_shared<samples::LoadedAvatar>();
  return person;
}

TEST(PeopleHistory, GoesBackAndForth) {
  PeopleHistory history;
  EXPECT_FALSE(history.can_undo());
  for (const uint64_t seed : {1, 2, 3}) history.add(person_of(seed));
  EXPECT_EQ(history.undo()->seed.seed, 2u);
  EXPECT_EQ(history.undo()->seed.seed, 1u);
  EXPECT_EQ(history.undo(), nullptr) << "before the first there was nobody";
  EXPECT_FALSE(history.can_undo());
  EXPECT_EQ(history.redo()->seed.seed, 1u);
  EXPECT_EQ(history.redo()->seed.seed, 2u);
  history.add(person_of(9));
  EXPECT_FALSE(history.can_redo()) << "another way was taken";
  EXPECT_EQ(history.undo()->seed.seed, 2u);
  for (uint64_t seed = 0; seed < 100; ++seed) history.add(person_of(seed));
  size_t steps = 0;
  while (history.can_undo()) history.undo(), ++steps;
  EXPECT_EQ(steps, PeopleHistory::kMost);
}

TEST(Script, ReadsEveryCommand) {
  const auto commands = parse_script(
      "# a walk\n\n  load some where/a b.fgn  \nremove 2\nplay\npause\nseek 1.5\nspeed 2\n"
      "orbit 30 -10 2.5\ndrag 10 -4\nzoom 3\nhome\nhome bust\nprofile a53-board\npace off\n"
      "set averted-above 0.3\nset stopped off\nmeasure on\nseed 7\nseed 7 8 0.25\nkeep\nundo\n"
      "redo\ncancel\nwait 0.5\nwait idle\nwait measured\nframes 3\npicture p.png\n"
      "screenshot s.png\nrecord r.webp\nstop\nstate s.json\ndrop x.ply\nquit\r\n",
      "walk.txt");
  ASSERT_TRUE(commands.ok()) << commands.status().message();
  ASSERT_EQ(commands->size(), 33u);
  EXPECT_EQ((*commands)[0].words, (std::vector<std::string>{"some where/a b.fgn"}));
  EXPECT_EQ((*commands)[0].line, 3u);
  EXPECT_EQ((*commands)[6].numbers, (std::vector<double>{30, -10, 2.5}));
  EXPECT_EQ((*commands)[24].verb, Verb::kWaitMeasured);
  EXPECT_EQ(commands->back().verb, Verb::kQuit);
}

TEST(Script, SaysWhatIsWrongWithALine) {
  const auto refused = [](const std::string& line, const std::string& reason) {
    const auto commands = parse_script("play\n" + line, "x.txt");
    ASSERT_FALSE(commands.ok()) << line;
    EXPECT_EQ(commands.status().message().rfind("x.txt: line 2: ", 0), 0u);
    EXPECT_NE(commands.status().message().find(reason), std::string::npos)
        << commands.status().message();
  };
  refused("fly", "'fly' is no command");
  refused("load", "wanted is load FILE");
  refused("play now", "wanted is play");
  refused("orbit 1 2", "wanted is orbit AZIMUTH");
  refused("seek soon", "wanted is seek SECONDS");
  refused("seek nan", "wanted is seek SECONDS");
  refused("seed -1", "wanted is seed NUMBER");
  refused("seed 1 2", "wanted is seed NUMBER");
  refused("seed 1 2 1.5", "wanted is seed NUMBER");
  refused("set toaster on", "wanted is set SWITCH");
  refused("set stopped 3", "wanted is set SWITCH");
  refused("profile toaster", "wanted is profile NAME");
  refused("home feet", "wanted is home");
  refused("wait -1", "wanted is wait");
  refused("remove 0", "wanted is remove");
  refused("pace maybe", "wanted is pace");
}

}  // namespace
}  // namespace figurine::emulator::parts_test
