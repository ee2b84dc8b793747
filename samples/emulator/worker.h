// Work that would freeze a window, on a thread of its own: one piece at a time. A wish that still
// waits is replaced by the next one, so that a slider which is dragged asks for where it is, not
// for where it was; what has begun is finished unless it is cancelled.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <new>
#include <optional>
#include <thread>
#include <utility>

#include "figurine/status.h"

namespace figurine::emulator {

template <class Wish, class Value>
class Worker {
 public:
  // Called by the worker's thread. It looks at cancelled now and then, and leaves with whatever
  // error it likes once that is true: nobody is told of it.
  using Work = std::function<Result<Value>(const Wish& wish, const std::atomic<bool>& cancelled)>;
  explicit Worker(Work work) : work_(std::move(work)), thread_([this] { run(); }) {}
  ~Worker() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = cancelled_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void ask(Wish wish) {
    {
      const std::lock_guard lock(mutex_);
      wish_ = std::move(wish);
    }
    changed_.notify_all();
  }
  // Forgets what waits, what runs and what was not taken yet.
  void cancel() {
    const std::lock_guard lock(mutex_);
    wish_.reset();
    outcomes_.clear();
    if (running_) cancelled_ = true;
  }
  // Until the last outcome was taken.
  bool busy() const {
    const std::lock_guard lock(mutex_);
    return wish_ || (running_ && !cancelled_) || !outcomes_.empty();
  }
  // The oldest outcome that was not taken yet.
  std::optional<Result<Value>> done() {
    const std::lock_guard lock(mutex_);
    if (outcomes_.empty()) return std::nullopt;
    std::optional<Result<Value>> outcome(std::move(outcomes_.front()));
    outcomes_.pop_front();
    return outcome;
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return stop_ || wish_; });
      if (stop_) return;
      const Wish wish = std::move(*wish_);
      wish_.reset();
      running_ = true, cancelled_ = false;
      lock.unlock();
      Result<Value> outcome = outcome_of(wish);
      lock.lock();
      running_ = false;
      if (!cancelled_) outcomes_.push_back(std::move(outcome));
    }
  }
  // What is beyond memory or reason here is a line in the window, not the end of it.
  Result<Value> outcome_of(const Wish& wish) {
    try {
      return work_(wish, cancelled_);
    } catch (const std::bad_alloc&) {
      return Status(StatusCode::kOutOfMemory, "out of memory");
    } catch (const std::exception& error) {
      return Status(StatusCode::kUnsupported, error.what());
    }
  }

  Work work_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Wish> wish_;
  std::deque<Result<Value>> outcomes_;
  bool running_ = false, stop_ = false;
  std::atomic<bool> cancelled_{false};
  std::thread thread_;  // last: it uses the others
};

}  // namespace figurine::emulator
