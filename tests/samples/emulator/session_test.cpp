// What the emulator does, without its window: files of every kind and broken ones, the picture that
// render draws, switches measured against the dense frame, devices, recordings, scripts.
#include "samples/emulator/session.h"

#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "ports/media/png.h"
#include "samples/emulator/script.h"
#include "samples/emulator/session_fixture.h"

namespace figurine::emulator::session_test {
namespace {

class Sessions : public SessionTest {};

TEST_F(Sessions, ShowsWhoeverIsOpened) {
  ASSERT_TRUE(session_->draw().ok());
  const std::vector<uint8_t> empty = session_->picture().u8.pixels;
  open("avatar.fgn");
  EXPECT_EQ(session_->figure_count(), 1u);
  EXPECT_NE(session_->picture().u8.pixels, empty) << "somebody is there";
  const std::vector<uint8_t> one = session_->picture().u8.pixels;
  open("people.fgn#bob");
  EXPECT_EQ(session_->figure_count(), 2u);
  EXPECT_NE(session_->picture().u8.pixels, one);
  ASSERT_EQ(session_->facts().size(), 2u);
  EXPECT_EQ(session_->facts()[1].title.rfind("people.fgn#bob, ", 0), 0u);
  EXPECT_FALSE(session_->facts()[1].lines.empty());
  EXPECT_TRUE(session_->remove_figure(0).ok());
  EXPECT_EQ(session_->figure(0).avatar.name, "bob");
  EXPECT_TRUE(session_->remove_figure(0).ok());
  EXPECT_EQ(session_->remove_figure(0).code(), StatusCode::kNotFound);
  ASSERT_TRUE(session_->draw().ok());
  EXPECT_EQ(session_->picture().u8.pixels, empty);
}

TEST_F(Sessions, ABrokenFileIsAMessage) {
  open("avatar.fgn");
  const std::vector<uint8_t> before = session_->picture().u8.pixels;
  for (const char* name : {"broken.fgn", "none.ply", "nobody.fgn", "people.fgn", "people.fgn#eve",
                           "other_body.fgn/"}) {
    const size_t messages = session_->messages().size();
    open(name);
    ASSERT_EQ(session_->messages().size(), messages + 1) << name;
    EXPECT_TRUE(last_is_error()) << name;
    const std::string bare = std::string(name).substr(0, std::string(name).find('#'));
    EXPECT_NE(last_message().find(bare), std::string::npos) << last_message();
    EXPECT_EQ(last_message().find('\n'), std::string::npos) << last_message();
  }
  EXPECT_EQ(session_->figure_count(), 1u);
  EXPECT_EQ(session_->picture().u8.pixels, before) << "nothing else has changed";
}

TEST_F(Sessions, ACoarsePackageDrawsAFigureThatIsSmall) {
  const tests::SyntheticAvatar other =
      tests::make_test_avatar(tests::make_test_body(), {.seed = 9});  // clearly somebody else
  const std::string coarse(reinterpret_cast<const char*>(other.bytes.bytes().data()),
                           other.bytes.bytes().size());
  packages_->write("figure.fgn", packages_->read("avatar.fgn"));
  packages_->write("figure-coarse.fgn", coarse);
  open("figure.fgn");
  EXPECT_EQ(session_->figure_count(), 1u);
  EXPECT_EQ(last_message(), "figure.fgn: an avatar, figure-coarse.fgn for when it is small");
  EXPECT_EQ(session_->json()["figures"][0]["coarse"], packages_->path("figure-coarse.fgn"));
  ASSERT_TRUE(session_->draw().ok());
  const std::vector<uint8_t> fine = session_->picture().u8.pixels;
  EXPECT_EQ(session_->statistics().coarse_avatars, 0u);
  Settings settings = session_->settings();
  ASSERT_TRUE(set_switch(settings, "coarse-below-px", "on").ok());
  session_->set_settings(settings);
  session_->set_paced(false);
  ASSERT_TRUE(run_until([&] { return session_->up_to_date(); }));
  EXPECT_EQ(session_->statistics().coarse_avatars, 1u);
  EXPECT_NE(session_->picture().u8.pixels, fine);
  const auto error_of_it = [&] {
    session_->set_measuring(true);
    EXPECT_TRUE(run_until([&] { return session_->study_is_current(); }));
    session_->set_measuring(false);
    size_t row = 0;
    while (std::string(switches()[row].name) != "coarse-below-px") ++row;
    return session_->study()->rows[row];
  };
  EXPECT_FALSE(error_of_it().same);
  EXPECT_GT(error_of_it().error_db, 5);
  EXPECT_LT(error_of_it().error_db, 60);
  session_->set_settings({});
  ASSERT_TRUE(run_until([&] { return session_->up_to_date(); }));
  EXPECT_EQ(session_->picture().u8.pixels, fine) << "and back";
  EXPECT_FALSE(error_of_it().same) << "what it would be is measured while it is off";

  // Dropped later, it finds its figure; another figure's is nobody's.
  ASSERT_TRUE(session_->remove_figure(0).ok());
  packages_->write("later.fgn", packages_->read("avatar.fgn"));
  open("later.fgn");
  EXPECT_TRUE(error_of_it().same) << "there is none";
  packages_->write("later-coarse.fgn", coarse);
  open("later-coarse.fgn");
  EXPECT_EQ(session_->figure_count(), 1u);
  EXPECT_EQ(last_message(), "later-coarse.fgn: for when later.fgn is small");
  EXPECT_FALSE(error_of_it().same);
  open("figure-coarse.fgn");
  EXPECT_EQ(session_->figure_count(), 2u);
  ASSERT_TRUE(session_->remove_figure(0).ok());
  ASSERT_TRUE(session_->remove_figure(0).ok());

  packages_->write("bad.fgn", packages_->read("avatar.fgn"));
  packages_->write("bad-coarse.fgn", packages_->read("broken.fgn"));
  open("bad.fgn");
  EXPECT_EQ(session_->figure_count(), 1u) << "shown all the same";
  EXPECT_TRUE(last_is_error());
  EXPECT_NE(last_message().find("bad-coarse.fgn: "), std::string::npos) << last_message();
}

TEST_F(Sessions, AMotionMovesEverybody) {
  open("avatar.fgn");
  open("motion.fgn");
  EXPECT_EQ(session_->motion_name(), "motion.fgn");
  EXPECT_EQ(session_->timeline().frames(), 12u);
  session_->timeline().set_playing(false);
  session_->seek(0);
  ASSERT_TRUE(session_->draw().ok());
  const std::vector<uint8_t> first = session_->picture().u8.pixels;
  session_->seek(0.3);
  ASSERT_TRUE(session_->draw().ok());
  EXPECT_NE(session_->picture().u8.pixels, first);
  const uint64_t pictures = session_->pictures();
  ASSERT_TRUE(session_->draw().ok());
  EXPECT_EQ(session_->pictures(), pictures) << "what stays is not drawn again";
  session_->seek(0);
  ASSERT_TRUE(session_->draw().ok());
  EXPECT_EQ(session_->picture().u8.pixels, first);
  // Those who come later join in.
  open("both.fgn");
  session_->seek(0.3);
  EXPECT_FALSE(last_is_error()) << last_message();
}

TEST_F(Sessions, ASceneAndFiguresTakeEachOthersPlace) {
  open("avatar.fgn");
  open("point.ply");
  EXPECT_EQ(session_->figure_count(), 0u);
  ASSERT_NE(session_->cloud(), nullptr);
  EXPECT_NE(last_message().find("in place of the figures"), std::string::npos) << last_message();
  const ports::ImageU8& picture = session_->picture().u8;
  const uint8_t* const middle = picture.at(picture.width_px / 2, picture.height_px / 2);
  EXPECT_GT(middle[0], middle[2]) << "a red point, in the middle";
  open("avatar.fgn");
  EXPECT_EQ(session_->cloud(), nullptr);
  EXPECT_EQ(session_->figure_count(), 1u);
  // Nothing of the scene's camera is left: everybody is in the picture again.
  ASSERT_TRUE(session_->home(samples::Framing::kBody).ok());
}

TEST_F(Sessions, TheCameraKeepsItsDirection) {
  open("avatar.fgn");
  session_->set_orbit(77, 12, 3);
  open("both.fgn");
  EXPECT_NEAR(session_->view().orbit().azimuth_deg, 77, 1e-3) << "somebody came";
  ASSERT_TRUE(session_->home(samples::Framing::kBody).ok());
  EXPECT_GT(std::abs(session_->view().orbit().azimuth_deg - 77), 1);
  EXPECT_EQ(session_->home(samples::Framing::kHead).code(), StatusCode::kUnsupported)
      << "the test's body has no head";
  (void)session_->draw();
  EXPECT_EQ(session_->figure_count(), 2u);
}

TEST_F(Sessions, MeasuresEverySwitchAgainstTheDenseFrame) {
  open("avatar.fgn");
  open("motion.fgn");
  session_->timeline().set_playing(false);
  session_->seek(0.2);
  Settings settings = session_->settings();
  ASSERT_TRUE(set_switch(settings, "fast-blend", "on").ok());
  ASSERT_TRUE(set_switch(settings, "averted-above", "0").ok());
  session_->set_settings(settings);
  session_->set_measuring(true);
  ASSERT_TRUE(run_until([&] { return session_->study_is_current(); }));
  const Study& study = *session_->study();
  EXPECT_GT(study.dense_ms, 0);
  for (size_t i = 0; i < switches().size(); ++i) {
    const Switch& each = switches()[i];
    const StudyRow& row = study.rows[i];
    if (each.exact) {
      EXPECT_TRUE(row.same) << each.name << ": " << row.error_db;
    }
    EXPECT_LE(row.gain_ms, study.dense_ms) << each.name;
    if (std::string(each.name) == "fast-blend") {
      EXPECT_FALSE(row.same);
      EXPECT_GT(row.error_db, 45) << row.error_db;
    }
    const std::string name = each.name;
    if (name == "averted-above" || name == "network-interval") {
      EXPECT_FALSE(row.same) << name;
    }
    if (name == "sh-degree") {
      EXPECT_TRUE(row.same) << "there are no bands";
    }
  }
  EXPECT_FALSE(study.as_set.same);
  // What shows shows in the picture too.
  (void)session_->draw();
  const std::vector<uint8_t> set = session_->picture().u8.pixels;
  session_->set_settings(dense_settings());
  ASSERT_TRUE(run_until([&] { return session_->study_is_current(); }));
  EXPECT_TRUE(session_->study()->as_set.same);
  (void)session_->draw();
  EXPECT_NE(session_->picture().u8.pixels, set);
}

TEST_F(Sessions, ADeviceHasItsScreenAndItsPace) {
  open("avatar.fgn");
  open("motion.fgn");
  const DeviceProfile& board = *find_profile("a53-board");
  ASSERT_TRUE(session_->set_profile(board).ok());
  session_->timeline().set_playing(true);
  ASSERT_TRUE(run_until([&] { return session_->estimate().has_value(); }));
  EXPECT_EQ(session_->picture().size.width_px, board.screen.width_px);
  EXPECT_EQ(session_->picture().u8.height_px, board.screen.height_px);
  const double device_ms = session_->estimate()->total_ms;
  EXPECT_GT(device_ms, 0);
  // In a second there are no more pictures than the device would have.
  const uint64_t before = session_->pictures();
  for (int i = 0; i < 1000; ++i) {
    session_->advance(0.001);
    (void)session_->draw();
  }
  const double shown = static_cast<double>(session_->pictures() - before);
  EXPECT_LE(shown, 1000 / device_ms + 2);
  EXPECT_GT(shown, 0);
  EXPECT_GT(session_->memory_bytes(), 0u);
  ASSERT_TRUE(session_->set_profile(*find_profile("desk")).ok());
  EXPECT_FALSE(session_->estimate()) << "measured, not estimated";
  EXPECT_EQ(session_->figure_count(), 1u) << "everybody came along";
  ASSERT_TRUE(session_->draw().ok());
}

TEST_F(Sessions, RecordsAsTheClockGoes) {
  open("avatar.fgn");
  ASSERT_TRUE(session_->set_profile(*find_profile("a53-panel")).ok());
  const std::string video = packages_->path("r.y4m");
  EXPECT_FALSE(session_->start_recording(packages_->path("r.png")).ok());
  EXPECT_TRUE(last_is_error());
  ASSERT_TRUE(session_->start_recording(video).ok());
  EXPECT_FALSE(session_->start_recording(video).ok()) << "one at a time";
  ASSERT_TRUE(run_until([&] { return session_->recorder()->frames() >= 3; }))
      << "a picture that stays goes on";
  EXPECT_FALSE(packages_->has("r.y4m")) << "appears whole";
  session_->stop_recording();
  ASSERT_TRUE(run_until([&] { return session_->idle(); }));
  const size_t frame_bytes = 6 + 480 * 480 * 3 / 2;
  EXPECT_GE(packages_->read("r.y4m").size(), 3 * frame_bytes);
  EXPECT_NE(last_message().find("r.y4m: "), std::string::npos) << last_message();
}

TEST_F(Sessions, AScriptDrivesIt) {
  const std::string picture = packages_->path("script.png"), state = packages_->path("state.json");
  auto commands = parse_script(
      "load " + packages_->path("avatar.fgn") + "\nload " + packages_->path("motion.fgn") +
          "\nwait idle\npause\nseek 0.2\norbit 20 5 3\nset stopped off\n"
          "remove 9\nload " +
          packages_->path("broken.fgn") + "\nwait idle\npicture " + picture +
          "\npicture /no/where.png\nmeasure on\n"
          "wait measured\nstate " +
          state + "\nframes 2\nquit\n",
      "test");
  ASSERT_TRUE(commands.ok()) << commands.status().message();
  Script script(std::move(*commands), "test");
  // Hardly any of the script's own time goes by: what it waits for in vain is not tried here.
  ASSERT_TRUE(run_until([&] { return script.step(*session_, 0.0001).quit; }));
  EXPECT_TRUE(script.over());
  const auto json = nlohmann::json::parse(packages_->read("state.json"));
  EXPECT_NEAR(json["time_s"].get<double>(), 0.2, 1e-6);
  EXPECT_NEAR(json["orbit"]["azimuth_deg"].get<double>(), 20, 1e-4);
  EXPECT_EQ(json["switches"]["stopped"], 0);
  EXPECT_EQ(json["study"]["switches"].size(), switches().size());
  EXPECT_EQ(json["figures"].size(), 1u);
  std::vector<std::string> errors;
  for (const auto& message : json["messages"]) {
    if (message["error"]) errors.push_back(message["text"]);
  }
  ASSERT_EQ(errors.size(), 3u) << json["messages"].dump(1);
  EXPECT_EQ(errors[0], "test: line 8: figure 9: there are 1");
  EXPECT_NE(errors[1].find("broken.fgn"), std::string::npos);
  EXPECT_NE(errors[2].find("/no/where.png"), std::string::npos);
  const std::string png = packages_->read("script.png");
  const auto image = ports::decode_png(std::as_bytes(std::span(png)), "script.png");
  ASSERT_TRUE(image.ok());
  EXPECT_EQ(image->width_px, session_->picture().size.width_px);
}

}  // namespace
}  // namespace figurine::emulator::session_test
