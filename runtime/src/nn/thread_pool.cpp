#include "runtime/src/nn/thread_pool.h"

#include <pthreadpool.h>

#include <string>

namespace figurine {

Result<ThreadPool> ThreadPool::create(uint32_t threads) {
  if (threads < 1 || threads > 64) {
    return Status(StatusCode::kInvalidArgument, "threads: must be between 1 and 64, not " + std::to_string(threads));
  }
  if (threads == 1) return ThreadPool(nullptr, 1);
  pthreadpool* handle = pthreadpool_create(threads);
  if (handle == nullptr) return Status(StatusCode::kOutOfMemory, "threads: the system cannot start " + std::to_string(threads));
  return ThreadPool(handle, threads);
}

ThreadPool::~ThreadPool() {
  if (handle_ != nullptr) pthreadpool_destroy(handle_);
}

void ThreadPool::run(size_t count, void (*task)(void*, size_t), void* context, Afterwards afterwards) {
  if (handle_ == nullptr || count <= 1) {
    for (size_t i = 0; i < count; ++i) task(context, i);
    return;
  }
  pthreadpool_parallelize_1d(handle_, task, context, count, afterwards == Afterwards::kSleep ? PTHREADPOOL_FLAG_YIELD_WORKERS : 0);
}

}  // namespace figurine
