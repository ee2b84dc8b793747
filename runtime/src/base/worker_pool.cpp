#include "runtime/src/base/worker_pool.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>

#include <algorithm>
#include <new>
#include <utility>
#include <vector>

#include "runtime/src/base/float_mode.h"

namespace figurine {
namespace {

// How often a thread looks before it sleeps: about 25 us on x86-64, where a pause takes 50 ns. A
// frame's loops follow each other faster than that; waking a sleeping thread costs as much.
constexpr int kLooks = 500;

void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("isb" ::: "memory");  // `yield` takes no time on most cores
#endif
}

// Returns what the word holds once that is not `value`.
uint32_t wait_while(const std::atomic<uint32_t>& word, uint32_t value) {
  for (int i = 0; i < kLooks; ++i) {
    const uint32_t now = word.load(std::memory_order_acquire);
    if (now != value) return now;
    pause();
  }
  word.wait(value);
  return word.load();
}

// Blocks all signals while threads are made, which inherit that: handlers are for the program's
// own threads.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

struct Worker {
  void* pool = nullptr;
  uint32_t thread = 0;  // from 1
  pthread_t handle{};
};

}  // namespace

struct WorkerPool::Impl {
  ~Impl() {
    ended.store(true);
    loops.fetch_add(1);
    loops.notify_all();
    for (uint32_t i = 0; i < started; ++i) ::pthread_join(workers[i].handle, nullptr);
  }

  void start(uint32_t count) {
    const SignalsBlocked blocked;
    for (; started < count; ++started) {
      Worker& worker = workers[started];
      worker = {.pool = this, .thread = started + 1};
      const auto live = [](void* argument) -> void* {
        const Worker& self = *static_cast<const Worker*>(argument);
        static_cast<Impl*>(self.pool)->live(self.thread);
        return nullptr;
      };
      if (::pthread_create(&worker.handle, nullptr, live, &worker) != 0) return;
    }
  }

  // A worker's life.
  void live(uint32_t thread) {
    for (uint32_t seen = 0;;) {
      seen = wait_while(loops, seen);
      if (ended.load()) return;
      if (!enter()) continue;
      mode.set();
      share(context, loop, thread);
      // The last one out of a closed loop: its caller may sleep.
      if (inside.fetch_sub(1, std::memory_order_release) == 1) inside.notify_one();
    }
  }

  bool enter() {
    uint32_t count = inside.load(std::memory_order_relaxed);
    while ((count & kOpen) != 0) {
      if (inside.compare_exchange_weak(count, count + 1, std::memory_order_acquire,
                                       std::memory_order_relaxed))
        return true;
    }
    return false;
  }

  static constexpr uint32_t kOpen = uint32_t{1} << 31;

  // The loop, written by its caller while it is closed and nobody is inside.
  Share share = nullptr;
  void* context = nullptr;
  FloatMode mode = FloatMode::exact();  // of the caller
  Loop loop;
  alignas(64) std::atomic<uint32_t> inside{
      0};                                      // workers in the loop, and kOpen while more may come
  alignas(64) std::atomic<uint32_t> loops{0};  // begun so far: what idle workers watch
  std::atomic<bool> running{false}, ended{false};

  uint32_t started = 0;
  Worker workers[kMaxThreads - 1];
};

WorkerPool::WorkerPool(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WorkerPool::~WorkerPool() = default;

std::unique_ptr<WorkerPool> WorkerPool::create(uint32_t threads) {
  std::unique_ptr<Impl> impl(new (std::nothrow) Impl);
  if (impl == nullptr) return nullptr;
  impl->start(threads - 1);
  return std::unique_ptr<WorkerPool>(new (std::nothrow) WorkerPool(std::move(impl)));
}

void WorkerPool::run(size_t count, Share share, void* context) {
  Impl& impl = *impl_;
  if (count <= 1 || impl.started == 0 || impl.running.exchange(true, std::memory_order_acquire)) {
    run_alone(count, share, context);
    return;
  }
  impl.share = share, impl.context = context, impl.mode = FloatMode::of_this_thread();
  impl.loop.count_ = count;
  impl.loop.next_.store(0, std::memory_order_relaxed);
  impl.inside.store(Impl::kOpen, std::memory_order_release);
  impl.loops.fetch_add(1);
  impl.loops.notify_all();
  share(context, impl.loop, 0);
  uint32_t inside = impl.inside.fetch_and(~Impl::kOpen, std::memory_order_acq_rel) & ~Impl::kOpen;
  while (inside != 0) inside = wait_while(impl.inside, inside);
  impl.running.store(false, std::memory_order_release);
}

void WorkerPool::run_alone(size_t count, Share share, void* context) {
  Loop loop;
  loop.count_ = count;
  share(context, loop, 0);
}

uint32_t WorkerPool::threads() const { return impl_->started + 1; }

uint32_t allowed_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  // A machine with more CPUs than the set has room for has more than a pool has threads.
  if (::sched_getaffinity(0, sizeof(set), &set) != 0) return WorkerPool::kMaxThreads;
  return static_cast<uint32_t>(std::max(CPU_COUNT(&set), 1));
}

}  // namespace figurine
