// Pictures into a moving picture, as they are seen: at a fixed rate of the clock, written by a
// thread of its own. A picture that stays is written again when its next time has come; where the
// writer is behind by seconds, pictures are lost and counted.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "samples/common/file_sink.h"

namespace figurine::emulator {

class Recorder {
 public:
  static constexpr double kFramesPerSecond = 30;
  static constexpr size_t kMostWaiting = 90;

  // What moves by its name: .webp, .y4m, .mp4 ... Errors: FileSink::create, kUnsupported for a name
  // of one picture.
  static Result<std::unique_ptr<Recorder>> start(const std::string& path, samples::ImageSize size,
                                                 uint64_t now_ns);
  ~Recorder();  // finishes
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // The picture that is seen now, of the size given, opaque. Does not wait.
  void offer(const samples::RenderedFrame& frame, uint64_t now_ns);
  // No more comes. Does not wait either: done() says how it ended.
  void stop();
  bool stopping() const { return stopping_; }
  std::optional<Status> done();

  const std::string& path() const { return path_; }
  uint64_t frames() const { return offered_ - lost_; }
  uint64_t lost() const { return lost_; }

 private:
  Recorder(std::string path, std::unique_ptr<samples::FileSink> sink, uint64_t now_ns);
  void run();

  std::string path_;
  std::unique_ptr<samples::FileSink> sink_;  // the thread's
  uint64_t start_ns_, offered_ = 0, lost_ = 0;
  bool stopping_ = false;

  std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  std::deque<std::shared_ptr<const samples::RenderedFrame>> waiting_;
  bool stop_ = false;
  std::optional<Status> ended_;
  std::thread thread_;
};

}  // namespace figurine::emulator
