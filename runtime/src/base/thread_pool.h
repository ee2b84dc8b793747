// The runtime's threads: workers for its own loops (worker_pool.h), and beside them the pthreadpool
// that XNNPACK insists on. Where drop_in_pthreadpool.cpp is linked that gives way as well; the
// system's waits by spinning.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "figurine/status.h"
#include "figurine/threads.h"
#include "runtime/src/base/worker_pool.h"

struct pthreadpool;

namespace figurine {

class ThreadPool {
 public:
  static constexpr uint32_t kMaxThreads = WorkerPool::kMaxThreads;

  // 1 to 64 threads, the caller's own counted. Fewer where the system does not give so many:
  // threads() says how many there are. kInvalidArgument, kOutOfMemory.
  static Result<ThreadPool> create(uint32_t threads);
  ThreadPool(ThreadPool&& other) noexcept;
  ThreadPool& operator=(ThreadPool&&) = delete;
  ~ThreadPool();

  // task(i) for every i in [0, count), in any order, on any thread; returns when all are done. See
  // WorkerPool::run.
  template <class Task>
  void for_each(size_t count, const Task& task) {
    workers_->run(
        count,
        [](void* context, WorkerPool::Loop& loop, uint32_t) {
          for (size_t i; loop.next(i);) (*static_cast<const Task*>(context))(i);
        },
        const_cast<Task*>(&task));
  }

  uint32_t threads() const { return workers_->threads(); }
  // Of as many threads. Null for one thread, as XNNPACK wants it. For XNNPACK by way of
  // xnnpack_pool() alone (runtime/src/nn/xnnpack_graph.h).
  pthreadpool* network_pool() const { return network_.get(); }

 private:
  struct PoolDeleter {
    void operator()(pthreadpool* pool) const;
  };
  ThreadPool(std::unique_ptr<WorkerPool> workers, pthreadpool* network);

  std::unique_ptr<WorkerPool> workers_;
  std::unique_ptr<pthreadpool, PoolDeleter> network_;
};

}  // namespace figurine
