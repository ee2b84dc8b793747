// Lines of poses: the newest that is sound is shown, the others are counted and said, few times;
// the end is known when the last pose was given.
#include "samples/common/pose_feed.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>
#include <vector>

#include "ports/host/clock.h"
#include "samples/common/pose_record.h"

namespace figurine::samples::pose_feed_test {
namespace {

std::mutex said_mutex;
std::vector<std::string> said;
void note(const std::string& line) {
  const std::lock_guard lock(said_mutex);
  said.push_back(line);
}

struct Stream {
  int read_end = -1, write_end = -1;
  Body body;
  std::vector<int16_t> parents = {-1, 0};
  std::unique_ptr<LineFeed> feed;
  std::unique_ptr<PoseSource> source;

  Stream() {
    said.clear();
    int ends[2];
    FIG_CHECK(::pipe(ends) == 0, "no pipe");
    read_end = ends[0], write_end = ends[1];
    body.joint_names = {"pelvis", "head"};
    body.parents = parents;
    feed = std::make_unique<LineFeed>(LineFeed::Options{
        .descriptor = read_end, .name = "stream", .say = note, .now_ns = ports::now_ns});
    source = std::move(feed->source_for(body)).value();
    feed->start();
  }
  ~Stream() {
    feed.reset();
    close_write();
    ::close(read_end);
  }
  void close_write() {
    if (write_end >= 0) ::close(write_end);
    write_end = -1;
  }
  void write(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t count = ::write(write_end, text.data(), text.size());
      ASSERT_GT(count, 0);
      text.remove_prefix(static_cast<size_t>(count));
    }
  }
  // Until so many lines were taken; a test that waits for ever is ended by its time limit.
  void wait_for_lines(uint64_t lines) const {
    while (feed->counts()["lines"].get<uint64_t>() < lines)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  void wait_for(const char* what, uint64_t count) const {
    while (feed->counts()[what].get<uint64_t>() < count)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::vector<float> shown() const {
    EXPECT_TRUE(feed->advance(0).ok());
    const PoseView pose = source->next(0).value();
    return {pose.rotations.begin(), pose.rotations.end()};
  }
};

TEST(LineFeed, GivesTheNewestSoundPose) {
  const Stream stream;
  EXPECT_EQ(stream.shown(), (std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0})) << "at rest before";
  EXPECT_EQ(stream.feed->arrived_ns(), std::nullopt);
  stream.write(R"({"joints": {"head": [0, 1, 0, 0]}})"
               "\n");
  stream.wait_for_lines(1);
  const uint64_t now_ns = ports::now_ns();
  EXPECT_EQ(stream.shown(), (std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0}));
  EXPECT_LE(*stream.feed->arrived_ns(), now_ns);
  stream.write("{\"joints\": {\"head\": [0, 0, 1, 0]}}\r\n\n  \n{\"joints\": {\"pelvis\":");
  stream.write(" [0, 0, 0, 1]}}\n{\"joints\": {\"tail\": [0, 0, 0, 1]}}\n");
  stream.wait_for_lines(4);
  EXPECT_EQ(stream.shown(), (std::vector<float>{0, 0, 0, 1, 1, 0, 0, 0}))
      << "each line is a whole pose, and a wrong one changes nothing";
  EXPECT_EQ(stream.feed->counts(),
            nlohmann::ordered_json({{"lines", 4}, {"records", 0}, {"poses", 3}, {"malformed", 1}}));
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].rfind("stream: line 4: joint 'tail'", 0), 0u) << said[0];
}

TEST(LineFeed, EndsWhenTheLastPoseWasGiven) {
  Stream stream;
  stream.write(R"({"joints": {"head": [0, 1, 0, 0]}})");  // no line's end
  stream.close_write();
  stream.wait_for_lines(1);
  EXPECT_EQ(stream.shown()[5], 1);
  EXPECT_FALSE(stream.feed->ended());
  for (int i = 0; i < 5000 && !stream.feed->ended(); ++i) {
    stream.shown();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(stream.feed->ended());
  EXPECT_EQ(stream.shown()[5], 1) << "and stays";
}

TEST(LineFeed, SaysTenWrongLinesAndCountsTheRest) {
  const Stream stream;
  for (int i = 0; i < 50; ++i) stream.write("nonsense\n");
  stream.wait_for_lines(50);
  while (stream.feed->counts()["malformed"] != 50)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const std::lock_guard lock(said_mutex);
  EXPECT_EQ(said.size(), 10u);
  EXPECT_NE(said.back().find("others are counted only"), std::string::npos);
}

TEST(LineFeed, ALineWithoutEndTakesNoMemory) {
  const Stream stream;
  const std::string block(1 << 16, 'x');
  for (int i = 0; i < 64; ++i) stream.write(block);
  stream.write("\n{\"joints\": {\"head\": [0, 1, 0, 0]}}\n");
  stream.wait_for_lines(2);
  while (stream.shown()[5] != 1) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(stream.feed->counts()["malformed"], 1);
  const std::lock_guard lock(said_mutex);
  EXPECT_EQ(said, std::vector<std::string>{"stream: line 1: longer than a mebibyte"});
}

std::string record(const std::vector<float>& rotations, std::array<float, 3> root = {0, 0, 0}) {
  const std::vector<std::byte> bytes = write_pose_record({root, rotations});
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(LineFeed, TakesRecordsAndLinesAsTheyCome) {
  const Stream stream;
  const std::vector<float> first = {0.6f, 0.8f, 0, 0, 1, 0, 0, 1e-30f},
                           second = {1, 2, 3, 4, 0, 0, 0, 1};
  stream.write(record(first, {0.1f, -0.0f, 3}));
  stream.wait_for("records", 1);
  EXPECT_EQ(stream.shown(), first) << "to the bit";
  stream.write("{\"joints\": {\"head\": [0, 1, 0, 0]}}\n" + record(second).substr(0, 5));
  stream.wait_for_lines(1);
  EXPECT_EQ(stream.shown()[5], 1);
  stream.write(record(second).substr(5));
  stream.wait_for("records", 2);
  EXPECT_EQ(stream.shown(), second);
  EXPECT_EQ(stream.feed->counts(),
            nlohmann::ordered_json({{"lines", 1}, {"records", 2}, {"poses", 3}, {"malformed", 0}}));
  EXPECT_EQ(stream.feed->summary(), "3 poses in 1 lines and 2 records, 0 malformed");
}

TEST(LineFeed, ReadsOnBehindARecordThatIsNone) {
  const Stream stream;
  const std::vector<float> pose = {0, 1, 0, 0, 0, 0, 1, 0};
  std::string version = record(pose), joints = record(pose), length = record(pose),
              nan = record(pose), zero = record({0, 0, 0, 0, 1, 0, 0, 0});
  version[8] = 2, joints[10] = 3, length[6] = 1;
  nan.replace(24, 4, std::string("\0\0\xc0\x7f", 4));
  uint64_t records = 0;
  for (const auto& [wrong, said_of_it] :
       {std::pair(version, "version 2 is not known, 1 is"),
        std::pair(joints, "3 joints: the body has 2"), std::pair(length, "no pose record"),
        std::pair(nan, "the rotation of joint 0 is zero or not finite"),
        std::pair(zero, "the rotation of joint 0 is zero or not finite"),
        std::pair(record({1, 0, 0, 0}), "1 joints: the body has 2"),
        std::pair(record(pose, {0, 20000, 0}), "root_translation_m: "),
        std::pair(std::string("\x8FPNG and what not"), "no pose record")}) {
    const std::vector<float> turned = {1, static_cast<float>(records), 0, 0, 1, 0, 0, 0};
    stream.write(wrong + record(turned));
    records += 2;
    stream.wait_for("records", records);
    EXPECT_EQ(stream.shown(), turned) << said_of_it;
    const std::lock_guard lock(said_mutex);
    ASSERT_EQ(said.size(), records / 2);
    EXPECT_EQ(said.back().rfind("stream: record " + std::to_string(records - 1) + ": ", 0), 0u);
    EXPECT_NE(said.back().find(said_of_it), std::string::npos) << said.back();
  }
}

TEST(LineFeed, ARecordThatTheEndCutsIsNoPose) {
  Stream stream;
  stream.write(record({0, 1, 0, 0, 1, 0, 0, 0}) + record({1, 0, 0, 0, 1, 0, 0, 0}).substr(0, 30));
  stream.close_write();
  stream.wait_for("records", 2);
  EXPECT_EQ(stream.shown()[1], 1);
  const std::lock_guard lock(said_mutex);
  EXPECT_EQ(said, std::vector<std::string>{"stream: record 2: the stream ends inside it"});
}

// Whatever bytes come: no crash, bounded memory, and a sound pose behind them is shown.
TEST(LineFeed, AnyBytesAreSurvived) {
  const Stream stream;
  const std::string whole = record({0, 1, 0, 0, 0, 0, 1, 0});
  std::mt19937 random(7);
  for (int i = 0; i < 3000; ++i) {
    std::string bytes = whole.substr(0, random() % (whole.size() + 1));
    for (int flips = static_cast<int>(random() % 4); flips > 0 && !bytes.empty(); --flips)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    stream.write(bytes);
  }
  stream.write(std::string(kMostPoseRecord, '\n'));  // past whatever was begun
  const std::vector<float> last = {0.5f, 0.5f, 0.5f, 0.5f, 1, 0, 0, 0};
  for (int i = 0; i < 5000 && stream.shown() != last; ++i) {
    stream.write(record(last));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(stream.shown(), last);
}

TEST(LineFeed, SaysThatTheStreamBroke) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  LineFeed feed({.descriptor = ends[1], .name = "stream", .say = note, .now_ns = ports::now_ns});
  feed.start();  // an end that cannot be read
  Status status;
  for (int i = 0; i < 5000 && status.ok(); ++i) {
    status = feed.advance(0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(status.message(), "stream: Bad file descriptor");
  ::close(ends[1]);
}

}  // namespace
}  // namespace figurine::samples::pose_feed_test
