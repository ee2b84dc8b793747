#include "runtime/src/base/thread_pool.h"

#include <pthreadpool.h>

#include <string>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace figurine {
namespace {

using Task = void (*)(void*, size_t);

#if defined(__SANITIZE_THREAD__)
// The pool's library is not instrumented, so the sanitizer does not see that a loop starts after
// its caller's writes and ends before its reads. Two marks say so; tasks of one loop stay unordered
// between each other, and their races are found.
struct Marked {
  Task task;
  void* context;
  char begin = 0, end = 0;
};

void run_marked(void* context, size_t i) {
  Marked& marked = *static_cast<Marked*>(context);
  __tsan_acquire(&marked.begin);
  marked.task(marked.context, i);
  __tsan_release(&marked.end);
}

void parallelize(pthreadpool* pool, Task task, void* context, size_t count, uint32_t flags) {
  Marked marked{.task = task, .context = context};
  __tsan_release(&marked.begin);
  pthreadpool_parallelize_1d(pool, run_marked, &marked, count, flags);
  __tsan_acquire(&marked.end);
}
#else
void parallelize(pthreadpool* pool, Task task, void* context, size_t count, uint32_t flags) {
  pthreadpool_parallelize_1d(pool, task, context, count, flags);
}
#endif

}  // namespace

Result<ThreadPool> ThreadPool::create(uint32_t threads) {
  if (threads < 1 || threads > 64) {
    return Status(StatusCode::kInvalidArgument,
                  "threads: must be between 1 and 64, not " + std::to_string(threads));
  }
  if (threads == 1) return ThreadPool(nullptr, 1);
  pthreadpool* handle = pthreadpool_create(threads);
  if (handle == nullptr)
    return Status(StatusCode::kOutOfMemory,
                  "threads: the system cannot start " + std::to_string(threads));
  return ThreadPool(handle, threads);
}

ThreadPool::~ThreadPool() {
  if (handle_ != nullptr) pthreadpool_destroy(handle_);
}

void ThreadPool::run(size_t count, void (*task)(void*, size_t), void* context,
                     Afterwards afterwards) {
  if (handle_ == nullptr || count <= 1) {
    for (size_t i = 0; i < count; ++i) task(context, i);
    return;
  }
  parallelize(handle_, task, context, count,
              afterwards == Afterwards::kSleep ? PTHREADPOOL_FLAG_YIELD_WORKERS : 0);
}

}  // namespace figurine
