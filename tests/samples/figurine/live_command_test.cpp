// figurine live from the outside: whole frames in every kind of output, the picture that render
// draws, and an end that says how it came.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "samples/figurine/live_loop.h"
#include "samples/program.h"

namespace figurine::tests::live_command_test {
namespace {

using Json = nlohmann::json;

constexpr size_t kFrameBytes = 6 + 32 * 32 * 3 / 2;

class LiveCommand : public testing::Test {
 protected:
  void SetUp() override { write_test_packages(folder_); }
  ProgramRun run(const std::string& arguments, RunOptions options = {}) {
    options.folder = folder_.path();
    return run_figurine("live avatar.fgn --threads 1 --size 32x32 " + arguments, options);
  }
  // What a shell does with the program, which is "$figurine" there.
  ProgramRun shell(const std::string& command) {
    return run_shell("figurine='" + std::string(figurine_program()) + "'; " + command, folder_);
  }
  Json json(const std::string& name = "live.json") { return Json::parse(folder_.read(name)); }

  // The frames of a sound stream.
  std::vector<std::string> frames(const std::string& stream, const std::string& rate) {
    const std::string header =
        "YUV4MPEG2 W32 H32 F" + rate + " Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
    EXPECT_EQ(stream.substr(0, header.size()), header);
    std::vector<std::string> result;
    if (stream.size() < header.size()) return result;
    EXPECT_EQ((stream.size() - header.size()) % kFrameBytes, 0u) << "a broken frame";
    for (size_t at = header.size(); at + kFrameBytes <= stream.size(); at += kFrameBytes) {
      EXPECT_EQ(stream.compare(at, 6, "FRAME\n"), 0);
      result.push_back(stream.substr(at + 6, kFrameBytes - 6));
    }
    return result;
  }
  // The frame that render draws of a pose file.
  std::string rendered(const std::string& pose) {
    const ProgramRun result = run_figurine(
        "render avatar.fgn --size 32x32 --pose " + pose + " --background '#dbe0e6' -o still.y4m",
        {.folder = folder_.path()});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const std::string video = folder_.read("still.y4m");
    return video.size() < kFrameBytes - 6 ? "" : video.substr(video.size() - kFrameBytes + 6);
  }

  TestFolder folder_;
};

TEST_F(LiveCommand, KeepsToKnownPosesWhereThatIsAskedFor) {
  folder_.write("bent.json", R"({"joints": {"joint1": [0.9, 0, 0], "joint2": [0, 0, 0.9]}})");
  const auto live = [&](const std::string& option) {
    const ProgramRun result = run_figurine(
        "live knowing.fgn --threads 1 --size 32x32 --pose bent.json --fps 30 --frames 3 --json "
        "live.json -o live.y4m " +
            option,
        {.folder = folder_.path()});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json();
  };
  const Json kept = live("--keep-to-known"), plain = live("");
  EXPECT_EQ(kept["keep_to_known"], true);
  EXPECT_EQ(kept["pulled_poses"], kept["shown_frames"]);
  EXPECT_EQ(plain["keep_to_known"], false);
  EXPECT_EQ(plain["pulled_poses"], 0);
}

TEST_F(LiveCommand, StreamsWholeFramesToStandardOutput) {
  const ProgramRun result = run("--pose motion.fgn --fps 8 --frames 4 --json live.json -o -");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json said = json();
  EXPECT_EQ(frames(result.out, "8:1").size(), said["shown_frames"].get<size_t>());
  EXPECT_EQ(said["shown_frames"].get<int>() + said["dropped_frames"].get<int>(), 4);
  EXPECT_EQ(said["frames"], 4);
  EXPECT_EQ(said["ended_by"], "frames");
  EXPECT_EQ(said["latency_ms"]["count"], said["shown_frames"]);
  EXPECT_GT(said["latency_ms"]["p99"].get<double>(), 0);
  EXPECT_GE(said["latency_ms"]["p99"], said["latency_ms"]["p50"]);
  EXPECT_GE(said["seconds"].get<double>(), 3 / 8.0) << "paced by the clock";
  EXPECT_TRUE(said["poses"].is_null());
  EXPECT_EQ(result.error_lines(), 1u) << result.err;
  EXPECT_NE(result.err.find("from pose to pixels p50 "), std::string::npos) << result.err;
}

TEST_F(LiveCommand, AFileHasTheFramesThatRenderDraws) {
  folder_.write("bent.json", R"({"joints": {"joint2": [0.9, 0, 0, 0.4]}})");
  const std::string wanted = rendered("bent.json");
  const ProgramRun result = run("--pose bent.json --fps 5 --frames 2 --json live.json -o x.y4m");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<std::string> got = frames(folder_.read("x.y4m"), "5:1");
  EXPECT_EQ(got.size(), json()["shown_frames"].get<size_t>());
  for (const std::string& frame : got) EXPECT_EQ(frame, wanted);
  for (const std::string& name : folder_.names()) EXPECT_FALSE(name.ends_with(".tmp")) << name;
}

// The motion walks away: a camera that went along would see other pictures.
TEST_F(LiveCommand, ACameraFromAFileStaysWhereItIs) {
  const auto render = [&](const std::string& arguments) {
    const ProgramRun result =
        run_figurine("render avatar.fgn --motion motion.fgn --size 32x32 " + arguments,
                     {.folder = folder_.path()});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  };
  folder_.write("camera.json", Json::parse(render("--json -o first.png"))["camera"].dump());
  render("--camera camera.json --background '#dbe0e6' --fps 30 -o all.y4m");
  const ProgramRun result =
      run("--pose motion.fgn --camera camera.json --fps 5 --frames 5 -o x.y4m");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<std::string> all = frames(folder_.read("all.y4m"), "30:1"),
                                 got = frames(folder_.read("x.y4m"), "5:1");
  EXPECT_EQ(all.size(), 12u);
  EXPECT_FALSE(got.empty());
  for (const std::string& frame : got)
    EXPECT_NE(std::find(all.begin(), all.end(), frame), all.end());
}

TEST_F(LiveCommand, LinesOfBothKindsMoveTheFigure) {
  const std::string quaternion = R"({"joints": {"joint2": [0.9, 0, 0, 0.4]}})",
                    axis =
                        R"({"root_translation_m": [0, 0.1, 0], "joints": {"joint1": [0.5, 0, 0]}})";
  folder_.write("a.json", quaternion);
  folder_.write("b.json", axis);
  folder_.write("a.line", quaternion + "\n");
  folder_.write("b.line", "no pose\n" + axis + "\n");
  const ProgramRun result = shell(
      "(cat a.line; sleep 2; cat b.line; sleep 1) | \"$figurine\" live avatar.fgn --threads 1 "
      "--size 32x32 --follow off --pose - --fps 8 --json live.json -o x.y4m");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json said = json();
  EXPECT_EQ(said["ended_by"], "poses");
  EXPECT_EQ(said["poses"], Json({{"lines", 3}, {"records", 0}, {"poses", 2}, {"malformed", 1}}));
  EXPECT_NE(result.err.find("standard input: line 2: pose: "), std::string::npos) << result.err;
  EXPECT_EQ(result.error_lines(), 2u) << result.err;
  EXPECT_LE(said["latency_ms"]["count"], 2);
  // The camera of live frames the golden pose; so does a file's that says nothing.
  std::vector<std::string> got = frames(folder_.read("x.y4m"), "8:1");
  got.erase(std::unique(got.begin(), got.end()), got.end());
  EXPECT_GE(got.size(), 2u) << "the pictures of two poses, after that of rest if it came first";
  EXPECT_LE(got.size(), 3u);
}

TEST_F(LiveCommand, ARecordDrawsWhatItsMotionsFrameDoes) {
  const auto render = [&](const std::string& more) {
    const ProgramRun drawn =
        run_figurine("render avatar.fgn --size 32x32 --motion motion.fgn --frames 7 " + more,
                     {.folder = folder_.path()});
    ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
    if (!drawn.out.empty()) {
      folder_.write("camera.json", Json::parse(drawn.out)["camera"].dump());
    }
  };
  render("--json -o first.png");
  render("--camera camera.json --background '#dbe0e6' -o still.y4m");
  const ProgramRun result = shell(
      "(printf '\\217POS too little'; '" FIGURINE_POSE_SEND
      "' motion.fgn --frame 3; '" FIGURINE_POSE_SEND
      "' motion.fgn --frame 7; sleep 1) | \"$figurine\" live avatar.fgn "
      "--threads 1 --size 32x32 --camera camera.json --pose - --fps 8 --json live.json -o x.y4m");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json()["ended_by"], "poses");
  EXPECT_EQ(json()["poses"], Json({{"lines", 0}, {"records", 3}, {"poses", 2}, {"malformed", 1}}));
  EXPECT_NE(result.err.find("standard input: record 1: no pose record"), std::string::npos)
      << result.err;
  const std::string still = folder_.read("still.y4m");
  const std::vector<std::string> shown = frames(folder_.read("x.y4m"), "8:1");
  ASSERT_FALSE(shown.empty());
  ASSERT_GT(still.size(), kFrameBytes);
  EXPECT_EQ(shown.back(), still.substr(still.size() - kFrameBytes + 6));
}

TEST_F(LiveCommand, AStreamWithoutAPoseIsAnError) {
  const ProgramRun empty = run("--pose - --fps 50 -o x.y4m < /dev/null");
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_NE(empty.err.find("standard input: ended without a pose"), std::string::npos) << empty.err;
  EXPECT_FALSE(folder_.has("x.y4m"));
  const ProgramRun closed = run("--pose - --fps 50 -o x.y4m <&-");
  EXPECT_EQ(closed.exit_code, 1);
  EXPECT_NE(closed.err.find("standard input: "), std::string::npos) << closed.err;
  EXPECT_FALSE(folder_.has("x.y4m"));
}

TEST_F(LiveCommand, AReaderThatClosesEarlyIsAnError) {
  const ProgramRun result = shell(
      "(\"$figurine\" live avatar.fgn --threads 1 --size 32x32 --pose motion.fgn --fps 60 "
      "--json live.json -o -; echo $? > code) | head -c 5000 > first");
  EXPECT_EQ(folder_.read("code"), "1\n");
  EXPECT_EQ(folder_.read("first").size(), 5000u);
  EXPECT_EQ(result.error_lines(), 2u) << "a summary and a reason\n" << result.err;
  EXPECT_NE(result.err.find("standard output: Broken pipe"), std::string::npos) << result.err;
  EXPECT_EQ(json()["ended_by"], "error");
}

TEST_F(LiveCommand, AFifoIsWaitedFor) {
  const ProgramRun result = shell(
      "mkfifo fifo && (sleep 0.5; cat fifo > copy) & "
      "\"$figurine\" live avatar.fgn --threads 1 --size 32x32 --pose motion.fgn --fps 10 "
      "--frames 3 --json live.json -o fifo; code=$?; wait; exit $code");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(frames(folder_.read("copy"), "10:1").size(), json()["shown_frames"].get<size_t>());
  // And nobody has to wait for ever.
  const ProgramRun alone =
      run("--pose motion.fgn -o fifo", {.before = "timeout --preserve-status -s INT 1"});
  EXPECT_EQ(alone.exit_code, 130) << alone.err;
  EXPECT_NE(alone.err.find("fifo: waiting for a reader"), std::string::npos) << alone.err;
}

TEST_F(LiveCommand, AnInterruptEndsItWithAWholeFile) {
  for (const auto& [signal, code] : {std::pair("INT", 130), std::pair("TERM", 143)}) {
    const ProgramRun result =
        run("--pose motion.fgn --fps 10 --json live.json -o x.y4m",
            {.before = std::string("timeout --preserve-status -s ") + signal + " 2"});
    EXPECT_EQ(result.exit_code, code) << result.err;
    EXPECT_EQ(json()["ended_by"], "interrupt");
    EXPECT_EQ(frames(folder_.read("x.y4m"), "10:1").size(), json()["shown_frames"].get<size_t>());
    EXPECT_EQ(result.error_lines(), 2u) << result.err;
  }
}

#ifdef FIGURINE_HAS_WINDOW
// SDL's dummy display is a window that nobody sees.
constexpr const char* kDummy = "SDL_VIDEODRIVER=dummy SDL_RENDER_DRIVER=software ";

TEST_F(LiveCommand, AWindowShowsTheFrames) {
  const ProgramRun result = run("--pose motion.fgn --fps 8 --frames 4 --json live.json -o window",
                                {.environment = kDummy});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json said = json();
  EXPECT_EQ(said["ended_by"], "frames");
  EXPECT_EQ(said["pixel_format"], "rgba8");
  EXPECT_GT(said["shown_frames"], 0);
  EXPECT_EQ(said["shown_frames"].get<int>() + said["dropped_frames"].get<int>(), 4);
  EXPECT_EQ(result.error_lines(), 1u) << result.err;
}

TEST_F(LiveCommand, AnInterruptEndsAWindow) {
  const ProgramRun result =
      run("--pose motion.fgn --fps 10 --json live.json -o window",
          {.before = std::string(kDummy) + "timeout --preserve-status -s INT 1"});
  EXPECT_EQ(result.exit_code, 130) << result.err;
  EXPECT_EQ(json()["ended_by"], "interrupt");
}

TEST_F(LiveCommand, AWindowWithoutADisplayIsOneLine) {
  const ProgramRun result = run("--pose motion.fgn --frames 4 -o window",
                                {.environment = "SDL_VIDEODRIVER=x11 DISPLAY= "});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.error_lines(), 1u) << result.err;
  EXPECT_NE(result.err.find("window: there is no display"), std::string::npos) << result.err;
}
#endif

// Somebody who has seen enough after two frames.
class TwoFrames final : public samples::LiveSink {
 public:
  TwoFrames() : LiveSink({.frames_per_second = 100}) {}
  PixelFormat format() const override { return PixelFormat::kRgba8; }
  bool closed() override { return counts().shown == 2; }

 private:
  Result<bool> put(const samples::RenderedFrame&, uint64_t) override { return true; }
};

TEST_F(LiveCommand, AWindowThatIsClosedEndsItWithoutAnError) {
  auto scene = samples::Scene::load({.avatars = {folder_.path("avatar.fgn")}});
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  auto renderer = Renderer::create({});
  ASSERT_TRUE(renderer.ok());
  ASSERT_TRUE(scene->add_to(**renderer, std::nullopt).ok());
  TwoFrames sink;
  Camera camera = scene->avatar(0).avatar.golden.camera;
  samples::LiveLoop loop{.scene = *scene,
                         .renderer = **renderer,
                         .sink = sink,
                         .camera = samples::FollowCamera(camera, {0, 0, 0}, false),
                         .size = {camera.width_px, camera.height_px},
                         .frames_per_second = 100};
  const samples::LiveRun run = samples::run_live(loop);
  EXPECT_EQ(run.end, samples::LiveEnd::kClosed);
  EXPECT_STREQ(to_string(run.end), "closed");
  EXPECT_TRUE(run.status.ok());
  EXPECT_EQ(sink.counts().shown, 2u);
}

TEST_F(LiveCommand, AFullDiskLeavesNothing) {
  const ProgramRun result = run("--pose motion.fgn --fps 30 --frames 30 -o x.y4m",
                                {.before = "trap '' XFSZ; ulimit -f 4;"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("x.y4m: "), std::string::npos) << result.err;
  EXPECT_FALSE(folder_.has("x.y4m"));
}

TEST_F(LiveCommand, BadInputGetsOneLineAndNoFile) {
  const auto refused = [&](const std::string& arguments, int code, const std::string& reason) {
    const std::vector<std::string> before = folder_.names();
    const ProgramRun result = run(arguments);
    EXPECT_EQ(result.exit_code, code) << arguments << "\n" << result.err;
    EXPECT_EQ(result.error_lines(), 1u) << arguments << "\n" << result.err;
    EXPECT_NE(result.err.find(reason), std::string::npos) << arguments << "\n" << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(folder_.names(), before);
  };
  folder_.write("wrong.json", R"({"joints": {"joint9": [1, 0, 0, 0]}})");
  refused("--pose none.fgn -o x.y4m", 1, "none.fgn");
  refused("--pose wrong.json -o x.y4m", 1, "joint 'joint9'");
  refused("--pose body.fgn -o x.y4m", 1, "not motion");
  refused("--pose vmc://nowhere:1 -o x.y4m", 1, "the address is none of IPv4");
  refused("--pose vmc:39539 -o x.y4m", 1, "not vmc://");
  refused("--pose motion.fgn -o x.mp4", 1, "x.mp4: live video goes to");
#ifndef FIGURINE_HAS_WINDOW
  refused("--pose motion.fgn -o window", 1,
          "window: this build has none: it was made without SDL2");
#endif
  refused("--pose motion.fgn -o /dev/video7777", 1, "/dev/video7777: cannot be opened for writing");
  refused("--pose motion.fgn -o no/such/x.y4m", 1, "no/such/x.y4m");
  refused("--pose motion.fgn -o .", 1, "neither a file");
  refused("--pose motion.fgn --background alpha -o x.y4m", 1, "chroma key");
  refused("--pose motion.fgn --json - -o -", 1, "cannot both have standard output");
  refused("--pose motion.fgn --camera none.json -o x.y4m", 1, "none.json");
  refused("--pose motion.fgn --behind /dev/video7777 -o x.y4m", 1,
          "behind: /dev/video7777: cannot be opened for reading");
  refused("--pose motion.fgn --behind /dev/null -o x.y4m", 1,
          "behind: /dev/null: is no video device");
  refused("-o x.y4m", 2, "--pose");
  refused("--pose motion.fgn", 2, "--output");
  refused("--pose motion.fgn --fps 0 -o x.y4m", 2, "--fps");
  refused("--pose motion.fgn --frames 3 --seconds 1 -o x.y4m", 2, "--seconds");
  // A body that no performer's bones fit. The line before it says where it listened.
  const ProgramRun bones = run("--pose vmc://:0 -o x.y4m");
  EXPECT_EQ(bones.exit_code, 1);
  EXPECT_NE(bones.err.find("avatar.fgn: body: "), std::string::npos) << bones.err;
  EXPECT_NE(bones.err.find("has no joint 'pelvis'"), std::string::npos) << bones.err;
}

// The shipped person and a performer who walks: pictures differ, everything sent is counted, the
// channels of expression are said once, and when the performer leaves the picture comes to rest.
TEST_F(LiveCommand, APerformerMovesTheFigure) {
  const std::string packages = FIGURINE_SOURCE_DIR "/samples/packages/";
  const ProgramRun result = shell(
      "\"$figurine\" live '" + packages +
      "person.fgn' --threads 1 --size 32x32 --follow off "
      "--pose vmc://:0 --fps 10 --seconds 9 --json live.json -o x.y4m 2> err & live=$!; "
      "until grep -q 'listening on vmc://127.0.0.1:' err; do sleep 0.05; done; "
      "port=$(sed -n 's/.*listening on vmc:..127.0.0.1://p' err); "
      "'" FIGURINE_VMC_SEND "' '" +
      packages + "body-128.fgn' '" + packages +
      "walk.fgn' "
      "--to 127.0.0.1:$port --seconds 3 --fps 30 || exit 99; wait $live; code=$?; cat err >&2; "
      "exit $code");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json said = json();
  EXPECT_GT(said["poses"]["poses"].get<int>(), 56 * 30);
  EXPECT_EQ(said["poses"]["malformed"], 0);
  EXPECT_EQ(said["poses"]["dropped"], 0);
  EXPECT_EQ(said["poses"]["channels"], 3);
  const std::string channels = "channels of expression that no avatar has, left out: Joy, A, Blink";
  const size_t at = result.err.find(channels);
  EXPECT_NE(at, std::string::npos) << result.err;
  EXPECT_EQ(result.err.find("channels of expression", at + 1), std::string::npos) << "once";
  std::vector<std::string> got = frames(folder_.read("x.y4m"), "10:1");
  EXPECT_EQ(got.size(), said["shown_frames"].get<size_t>());
  ASSERT_GE(got.size(), 3u);
  EXPECT_EQ(got[got.size() - 1], got[got.size() - 2]) << "at rest, three seconds after the last";
  std::sort(got.begin(), got.end());
  const auto different = std::unique(got.begin(), got.end()) - got.begin();
  EXPECT_GT(different, 5);
}

}  // namespace
}  // namespace figurine::tests::live_command_test
