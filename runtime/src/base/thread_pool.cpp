#include "runtime/src/base/thread_pool.h"

#include <pthread.h>
#include <pthreadpool.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <new>
#include <string>
#include <utility>

#include "figurine/detail/memory_reserve.h"
#include "runtime/src/base/drop_in_pthreadpool.h"

namespace figurine {
namespace {

// How many threads, `wanted` at most, the system would start now. The system's pthreadpool_create
// waits for ever for one that it could not start, so this starts them first, all at once, and ends
// them again.
uint32_t count_startable(uint32_t wanted) {
  struct Probe {
    std::atomic<uint32_t>* over = nullptr;
    pthread_t thread{};
    std::atomic<pid_t> id{0};
  };
  std::atomic<uint32_t> over{0};
  const std::unique_ptr<Probe[]> probes(new (std::nothrow) Probe[wanted]);
  if (probes == nullptr) return 0;
  const auto probe = [](void* argument) -> void* {
    Probe& self = *static_cast<Probe*>(argument);
    self.id.store(::gettid());
    self.over->wait(0);
    return nullptr;
  };
  uint32_t started = 0;
  for (; started < wanted; ++started) {
    probes[started].over = &over;
    if (::pthread_create(&probes[started].thread, nullptr, probe, &probes[started]) != 0) break;
  }
  over.store(1);
  over.notify_all();
  for (uint32_t i = 0; i < started; ++i) {
    ::pthread_join(probes[i].thread, nullptr);
    // A joined thread counts against the user's limit for a moment longer, until the kernel has
    // forgotten its number.
    while (::tgkill(::getpid(), probes[i].id.load(), 0) == 0) ::sched_yield();
  }
  return started;
}

pthreadpool* create_network_pool(uint32_t threads) {
  if (figurine_drop_in_pthreadpool == nullptr) return ::pthreadpool_create(threads);
  return figurine_drop_in_pthreadpool()->create(threads);
}

}  // namespace

void ThreadPool::PoolDeleter::operator()(pthreadpool* pool) const {
  if (figurine_drop_in_pthreadpool == nullptr) return ::pthreadpool_destroy(pool);
  figurine_drop_in_pthreadpool()->destroy(pool);
}

ThreadPool::ThreadPool(std::unique_ptr<WorkerPool> workers, pthreadpool* network)
    : workers_(std::move(workers)), network_(network) {}
ThreadPool::ThreadPool(ThreadPool&& other) noexcept = default;
ThreadPool::~ThreadPool() = default;

Result<ThreadPool> ThreadPool::create(uint32_t threads) {
  if (threads < 1 || threads > kMaxThreads) {
    return Status(StatusCode::kInvalidArgument,
                  "threads: must be between 1 and 64, not " + std::to_string(threads));
  }
  // Half of them for XNNPACK.
  if (threads > 1) threads = 1 + count_startable(2 * (threads - 1)) / 2;
  pthreadpool* const network = threads > 1 ? create_network_pool(threads) : nullptr;
  ThreadPool pool(WorkerPool::create(threads), network);
  if (pool.workers_ == nullptr || (threads > 1 && network == nullptr))
    return Status(StatusCode::kOutOfMemory, "threads: no memory for a pool");
  return pool;
}

Result<std::shared_ptr<ThreadPool>> make_thread_pool(const ThreadOptions& options) {
  const MemoryReserve reserve;
  if (!reserve.held()) return no_memory();
  uint32_t threads = options.threads;
  if (threads <= ThreadPool::kMaxThreads && !options.allow_oversubscription)
    threads = std::min(threads, allowed_cpus());
  Result<ThreadPool> pool = ThreadPool::create(threads);
  if (!pool.ok()) return pool.status();
  std::shared_ptr<ThreadPool> shared(new (std::nothrow) ThreadPool(std::move(pool).value()));
  if (shared == nullptr) return Status(StatusCode::kOutOfMemory, "threads: no memory for a pool");
  return shared;
}

uint32_t thread_count(const ThreadPool& pool) { return pool.threads(); }

}  // namespace figurine
