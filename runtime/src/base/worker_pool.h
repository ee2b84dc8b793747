// Threads that share loops, and that give way. A worker without work looks for more for
// microseconds, then sleeps until the next loop. A loop begins with its caller and takes in whoever
// comes: it waits for no worker that has not come, so where other programs hold the CPUs the caller
// does the work itself.
//
// Tasks are handed out dynamically, so a loop's result may depend on its own index only, never on
// which thread ran it.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace figurine {

class WorkerPool {
 public:
  static constexpr uint32_t kMaxThreads = 64;

  // The caller's own thread counted; 1 to kMaxThreads. Fewer where the system does not give so
  // many: threads() says how many there are. Null where there is no memory.
  static std::unique_ptr<WorkerPool> create(uint32_t threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // What a thread of a loop does: takes indices with next() until there are none.
  class Loop;
  using Share = void (*)(void* context, Loop& loop, uint32_t thread);

  // share(context, loop, thread) on the caller's thread, 0, and on workers, 1 and up, that come in
  // time; returns when all indices of [0, count) are done. Workers compute in their caller's
  // FloatMode. A loop begun while another runs, within it or by another thread, runs on its
  // caller's thread alone.
  void run(size_t count, Share share, void* context);
  static void run_alone(size_t count, Share share, void* context);

  uint32_t threads() const;

 private:
  struct Impl;
  explicit WorkerPool(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

class WorkerPool::Loop {
 public:
  // Whether there was an index left; then it is the caller's.
  bool next(size_t& i) {
    i = next_.fetch_add(1, std::memory_order_relaxed);
    return i < count_;
  }
  // The same for up to `most` indices that follow each other, [begin, end): one look at what the
  // threads share for all of them.
  bool next(size_t most, size_t& begin, size_t& end) {
    begin = next_.fetch_add(most, std::memory_order_relaxed);
    if (begin >= count_) return false;
    end = most < count_ - begin ? begin + most : count_;
    return true;
  }

 private:
  friend class WorkerPool;
  alignas(64) std::atomic<size_t> next_{0};
  size_t count_ = 0;
};

// CPUs that this process may run on, by its affinity mask.
uint32_t allowed_cpus();

}  // namespace figurine
