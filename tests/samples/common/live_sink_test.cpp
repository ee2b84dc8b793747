// Show or drop: frames too late to be drawn, and those that nobody takes, are dropped; what a
// reader sees of a pipe is a sound stream of whole frames whatever was dropped.
#include "samples/common/live_sink.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include "samples/common/y4m_pipe.h"

namespace figurine::samples::live_sink_test {
namespace {

constexpr uint64_t kMs = 1'000'000;
uint64_t fake_now_ns = 0;

// Notes what reaches it; does as told.
class NotingSink final : public LiveSink {
 public:
  NotingSink() : LiveSink({.frames_per_second = 50, .now_ns = [] { return fake_now_ns; }}) {}
  PixelFormat format() const override { return PixelFormat::kRgba8; }

  bool takes = true;
  Status error;
  int offered = 0;
  uint64_t deadline_ns = 0;

 private:
  Result<bool> put(const RenderedFrame&, uint64_t deadline) override {
    ++offered;
    deadline_ns = deadline;
    if (!error.ok()) return error;
    return takes;
  }
};

const RenderedFrame& any_frame() {
  static const RenderedFrame frame({2, 2}, PixelFormat::kRgba8);
  return frame;
}

TEST(LiveSink, ShowsWhatIsInTime) {
  NotingSink sink;
  fake_now_ns = 1000 * kMs;
  EXPECT_TRUE(*sink.show(any_frame(), 1000 * kMs));  // on the dot
  EXPECT_TRUE(*sink.show(any_frame(), 981 * kMs));   // 19 of 20 ms late: its own time still
  EXPECT_TRUE(*sink.show(any_frame(), 1500 * kMs));  // early
  EXPECT_EQ(sink.deadline_ns, 1520 * kMs);
  EXPECT_EQ(sink.counts().shown, 3u);
  EXPECT_EQ(sink.counts().late, 0u);
  EXPECT_EQ(sink.counts().dropped, 0u);
}

TEST(LiveSink, DropsWhatIsLateBeforeItIsDrawn) {
  NotingSink sink;
  fake_now_ns = 1000 * kMs;
  EXPECT_TRUE(sink.drop_late(980 * kMs));
  EXPECT_TRUE(sink.drop_late(0));
  EXPECT_FALSE(sink.drop_late(981 * kMs));
  EXPECT_EQ(sink.offered, 0);
  EXPECT_EQ(sink.counts().shown, 0u);
  EXPECT_EQ(sink.counts().dropped, 2u);
}

// A machine that needs three intervals a frame shows every third, and its receiver has until the
// next tick to take it.
TEST(LiveSink, ShowsWhatWasDrawnHoweverLongThatTook) {
  NotingSink sink;
  uint64_t due = 1000 * kMs;
  for (int k = 0; k < 4; ++k) {
    fake_now_ns = due + 61 * kMs;
    EXPECT_TRUE(*sink.show(any_frame(), due));
    EXPECT_EQ(sink.deadline_ns, due + 80 * kMs);
    for (due += 20 * kMs; sink.drop_late(due);) due += 20 * kMs;
  }
  EXPECT_EQ(sink.counts().shown, 4u);
  EXPECT_EQ(sink.counts().late, 4u);
  EXPECT_EQ(sink.counts().dropped, 8u);
}

TEST(LiveSink, CountsWhatNobodyTook) {
  NotingSink sink;
  fake_now_ns = 0;
  sink.takes = false;
  EXPECT_FALSE(*sink.show(any_frame(), 0));
  sink.takes = true;
  EXPECT_TRUE(*sink.show(any_frame(), 0));
  EXPECT_EQ(sink.counts().shown, 1u);
  EXPECT_EQ(sink.counts().dropped, 1u);
}

TEST(LiveSink, SaysThatTheReceiverIsGone) {
  NotingSink sink;
  fake_now_ns = 0;
  sink.error = Status(StatusCode::kIo, "window: closed");
  EXPECT_EQ(sink.show(any_frame(), 0).status().message(), "window: closed");
  EXPECT_EQ(sink.counts().shown + sink.counts().dropped, 0u);
}

// A pipe that holds less than one frame, so that a reader who pauses is felt.
struct Pipe {
  int read_end = -1, write_end = -1;
  Pipe() {
    std::signal(SIGPIPE, SIG_IGN);
    int ends[2];
    FIG_CHECK(::pipe2(ends, O_CLOEXEC) == 0, "no pipe");
    read_end = ends[0], write_end = ends[1];
  }
  ~Pipe() {
    close_read();
    close_write();
  }
  void close_read() {
    if (read_end >= 0) ::close(read_end);
    read_end = -1;
  }
  void close_write() {
    if (write_end >= 0) ::close(write_end);
    write_end = -1;
  }
  // What is there now, or all until the other end closes.
  std::string read_some(size_t most) const {
    std::string bytes(most, '\0');
    const ssize_t count = ::read(read_end, bytes.data(), most);
    bytes.resize(count > 0 ? static_cast<size_t>(count) : 0);
    return bytes;
  }
  std::string read_all() const {
    std::string bytes;
    for (std::string part = read_some(65536); !part.empty(); part = read_some(65536)) bytes += part;
    return bytes;
  }
};

constexpr ImageSize kSize{320, 240};  // 115,200 bytes of planes; a pipe holds 65,536
constexpr size_t kFrameBytes = 6 + kSize.width_px * kSize.height_px * 3 / 2;

RenderedFrame grey(uint8_t level) {
  RenderedFrame frame(kSize, PixelFormat::kRgb24);
  std::fill(frame.u8.pixels.begin(), frame.u8.pixels.end(), level);
  return frame;
}

// A header, then whole frames, each of one grey; their lumas.
std::vector<int> lumas_of(const std::string& stream) {
  const size_t line = stream.find('\n');
  EXPECT_EQ(stream.rfind("YUV4MPEG2 W320 H240 F", 0), 0u);
  if (line == std::string::npos) return {};
  EXPECT_EQ((stream.size() - line - 1) % kFrameBytes, 0u) << "a broken frame";
  std::vector<int> lumas;
  for (size_t at = line + 1; at + kFrameBytes <= stream.size(); at += kFrameBytes) {
    EXPECT_EQ(stream.compare(at, 6, "FRAME\n"), 0);
    const std::string luma = stream.substr(at + 6, kSize.width_px * kSize.height_px);
    EXPECT_EQ(luma.find_first_not_of(luma[0]), std::string::npos) << "a frame of two pictures";
    lumas.push_back(static_cast<uint8_t>(luma[0]));
  }
  return lumas;
}

TEST(Y4mPipe, GivesAReaderEveryFrame) {
  Pipe pipe;
  std::string stream;
  std::thread reader([&] { stream = pipe.read_all(); });
  auto sink = Y4mPipe::create(pipe.write_end, "pipe", kSize, {.frames_per_second = 0.1});
  ASSERT_TRUE(sink.ok());
  for (const uint8_t level : {0, 128, 255})
    EXPECT_TRUE(*(*sink)->show(grey(level), ports::now_ns()));
  EXPECT_TRUE((*sink)->finish().ok());
  pipe.close_write();
  reader.join();
  EXPECT_EQ(lumas_of(stream), (std::vector<int>{16, 126, 235}));
  EXPECT_EQ((*sink)->counts().dropped, 0u);
}

TEST(Y4mPipe, DropsFramesThatAPausedReaderMisses) {
  Pipe pipe;
  auto sink = Y4mPipe::create(pipe.write_end, "pipe", kSize, {.frames_per_second = 100});
  ASSERT_TRUE(sink.ok());
  const auto show = [&](uint8_t level) { return *(*sink)->show(grey(level), ports::now_ns()); };
  EXPECT_TRUE(show(0)) << "begun: the pipe holds half of it";
  const uint64_t start_ns = ports::now_ns();
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(show(128));
  EXPECT_GE(ports::now_ns() - start_ns, 5 * 9 * kMs) << "waits for the reader, a frame's time each";
  std::string stream;
  std::thread reader([&] { stream = pipe.read_all(); });
  // The reader is back: the rest of the first frame goes out before a later one does.
  int tries = 0;
  while (!show(255) && ++tries < 1000) {
  }
  EXPECT_TRUE((*sink)->finish().ok());
  pipe.close_write();
  reader.join();
  EXPECT_EQ(lumas_of(stream), (std::vector<int>{16, 235}));
  EXPECT_EQ((*sink)->counts().shown, 2u);
  EXPECT_EQ((*sink)->counts().dropped, 5u + static_cast<uint64_t>(tries));
}

TEST(Y4mPipe, AFrameThatNobodyBeganToReadIsForgotten) {
  Pipe pipe;
  // Filled to the brim by somebody else.
  ASSERT_EQ(::fcntl(pipe.write_end, F_SETFL, O_NONBLOCK), 0);
  const std::string block(4096, 'x');
  size_t filled = 0;
  for (ssize_t n; (n = ::write(pipe.write_end, block.data(), block.size())) > 0;)
    filled += static_cast<size_t>(n);
  auto sink = Y4mPipe::create(pipe.write_end, "pipe", kSize, {.frames_per_second = 100});
  ASSERT_TRUE(sink.ok());
  EXPECT_FALSE(*(*sink)->show(grey(0), ports::now_ns()));
  std::string stream;
  std::thread reader([&] { stream = pipe.read_all(); });
  while (!*(*sink)->show(grey(255), ports::now_ns())) {
  }
  EXPECT_TRUE((*sink)->finish().ok());
  pipe.close_write();
  reader.join();
  EXPECT_EQ(lumas_of(stream.substr(filled)), (std::vector<int>{235})) << "header and one frame";
}

TEST(Y4mPipe, SaysThatTheReaderIsGone) {
  Pipe pipe;
  auto sink = Y4mPipe::create(pipe.write_end, "out", kSize, {});
  ASSERT_TRUE(sink.ok());
  pipe.close_read();
  const Result<bool> shown = (*sink)->show(grey(0), ports::now_ns());
  EXPECT_EQ(shown.status().code(), StatusCode::kIo);
  EXPECT_EQ(shown.status().message(), "out: Broken pipe");
}

TEST(Y4mPipe, FinishDoesNotWaitForEver) {
  Pipe pipe;
  auto sink = Y4mPipe::create(pipe.write_end, "out", kSize, {.frames_per_second = 100});
  ASSERT_TRUE(sink.ok());
  EXPECT_TRUE(*(*sink)->show(grey(0), ports::now_ns()));
  EXPECT_EQ((*sink)->finish().message(), "out: the reader stopped inside a frame");
}

TEST(Y4mPipe, RefusesRatesThatY4mCannotSay) {
  const auto sink = Y4mPipe::create(1, "out", kSize, {.frames_per_second = 0});
  EXPECT_EQ(sink.status().message(), "out: frame rate: must be between 0.01 and 1000 a second");
}

}  // namespace
}  // namespace figurine::samples::live_sink_test
