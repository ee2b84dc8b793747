// Threads that several renderers share: a device that shows two scenes by turns, or one thread a
// scene, needs no more of them than CPUs.
//
//   auto threads = make_thread_pool({.threads = 4});
//   auto scene = Renderer::create({.pool = *threads}), inset = Renderer::create({.pool =
//   *threads});
//
// Renderers on different threads may use one pool at the same time: work that finds it busy runs on
// its caller's thread alone. Pixels depend on neither.
#pragma once

#include <cstdint>
#include <memory>

#include "figurine/status.h"

namespace figurine {

struct ThreadOptions {
  // 1 to 64, the caller's own counted. No more are started than the CPUs that the process may run
  // on, and fewer where the system gives no more: thread_count() says how many.
  uint32_t threads = 1;
  bool allow_oversubscription = false;  // more threads than CPUs: slower, for tests and experiments
};

class ThreadPool;

// kInvalidArgument for a number out of range, kOutOfMemory. Lives as long as somebody holds it.
Result<std::shared_ptr<ThreadPool>> make_thread_pool(const ThreadOptions& options);
uint32_t thread_count(const ThreadPool& pool);

}  // namespace figurine
