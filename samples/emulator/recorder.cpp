#include "samples/emulator/recorder.h"

#include <cmath>
#include <new>
#include <utility>

namespace figurine::emulator {

Result<std::unique_ptr<Recorder>> Recorder::start(const std::string& path, samples::ImageSize size,
                                                  uint64_t now_ns) {
  if (!samples::is_video_name(path)) {
    return Status(StatusCode::kUnsupported,
                  path + ": what moves is recorded as .webp, .y4m, .mp4, .webm or .gif");
  }
  Result<std::unique_ptr<samples::FileSink>> sink = samples::FileSink::create(
      path, {.size = size, .frames_per_second = kFramesPerSecond, .opaque = true});
  if (!sink.ok()) return sink.status();
  return std::unique_ptr<Recorder>(new Recorder(path, std::move(*sink), now_ns));
}

Recorder::Recorder(std::string path, std::unique_ptr<samples::FileSink> sink, uint64_t now_ns)
    : path_(std::move(path)),
      sink_(std::move(sink)),
      start_ns_(now_ns),
      thread_([this] { run(); }) {}

Recorder::~Recorder() {
  stop();
  thread_.join();
}

void Recorder::offer(const samples::RenderedFrame& frame, uint64_t now_ns) {
  const auto due = static_cast<uint64_t>(
      std::floor(static_cast<double>(now_ns - start_ns_) * 1e-9 * kFramesPerSecond) + 1);
  if (due <= offered_ || stopping_) return;
  const auto copy = std::make_shared<const samples::RenderedFrame>(frame);
  {
    const std::lock_guard lock(mutex_);
    for (; offered_ < due; ++offered_) {
      if (waiting_.size() < kMostWaiting) {
        waiting_.push_back(copy);
      } else {
        ++lost_;
      }
    }
  }
  changed_.notify_all();
}

void Recorder::stop() {
  stopping_ = true;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
}

std::optional<Status> Recorder::done() {
  const std::lock_guard lock(mutex_);
  return ended_;
}

void Recorder::run() {
  Status status;
  uint32_t number = 0;
  try {
    while (status.ok()) {
      std::shared_ptr<const samples::RenderedFrame> frame;
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return stop_ || !waiting_.empty(); });
        if (waiting_.empty()) break;
        frame = std::move(waiting_.front());
        waiting_.pop_front();
      }
      status = sink_->add(*frame, number++);
    }
    if (status.ok() && number == 0)
      status = Status(StatusCode::kInvalidArgument, path_ + ": nothing was recorded");
    if (status.ok()) status = sink_->finish();
  } catch (const std::bad_alloc&) {
    status = Status(StatusCode::kOutOfMemory, path_ + ": out of memory");
  }
  const std::lock_guard lock(mutex_);
  ended_ = status;
}

}  // namespace figurine::emulator
