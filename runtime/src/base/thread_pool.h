// One set of threads for everything: XNNPACK's operators and our own loops share a pthreadpool.
//
// Tasks of a loop are handed out dynamically, so a loop's result may depend on its own index only,
// never on which thread ran it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "figurine/status.h"

struct pthreadpool;

namespace figurine {

class ThreadPool {
 public:
  // 1 to 64 threads, the caller's own counted. One thread needs no pool at all.
  static Result<ThreadPool> create(uint32_t threads);
  ThreadPool(ThreadPool&& other) noexcept
      : handle_(std::exchange(other.handle_, nullptr)), threads_(other.threads_) {}
  ThreadPool& operator=(ThreadPool&&) = delete;
  ~ThreadPool();

  enum class Afterwards : uint8_t {
    kSpin,   // workers expect another loop soon
    kSleep,  // the last loop of a frame: workers give their cores back
  };

  // task(i) for every i in [0, count), in any order, on any thread; returns when all are done.
  template <class Task>
  void for_each(size_t count, const Task& task, Afterwards afterwards = Afterwards::kSpin) {
    run(
        count, [](void* context, size_t i) { (*static_cast<const Task*>(context))(i); },
        const_cast<Task*>(&task), afterwards);
  }

  uint32_t threads() const { return threads_; }
  pthreadpool* handle() const { return handle_; }  // null for one thread, as XNNPACK wants it

 private:
  ThreadPool(pthreadpool* handle, uint32_t threads) : handle_(handle), threads_(threads) {}
  void run(size_t count, void (*task)(void*, size_t), void* context, Afterwards afterwards);

  pthreadpool* handle_ = nullptr;
  uint32_t threads_ = 1;
};

}  // namespace figurine
