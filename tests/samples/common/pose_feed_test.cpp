// Lines of poses: the newest that is sound is shown, the others are counted and said, few times;
// the end is known when the last pose was given.
#include "samples/common/pose_feed.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "ports/host/clock.h"

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
            nlohmann::ordered_json({{"lines", 4}, {"poses", 3}, {"malformed", 1}}));
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
