#include "figurine/detail/memory_reserve.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <new>
#include <string>
#include <utility>

namespace figurine {
namespace {

// Small reserves that nobody holds: as many as were held at once.
struct Kept {
  Kept* next;
};

constinit std::mutex mutex;
constinit Kept* kept = nullptr;  // under the mutex
constinit size_t reserves = 0;   // of all threads, under the mutex
constinit std::atomic<std::new_handler> handler_before{nullptr};
constinit thread_local MemoryReserve* innermost = nullptr;
constinit thread_local bool may_fail = false;

// What is kept goes when the library is unloaded.
struct Unloading {
  ~Unloading() {
    while (kept != nullptr) ::operator delete(std::exchange(kept, kept->next));
  }
} unloading;

}  // namespace

Status no_memory() { return Status(StatusCode::kOutOfMemory, "no memory"); }

void* try_allocate(size_t size_bytes, size_t alignment) {
  const bool outer = std::exchange(may_fail, true);
  void* const block = ::operator new(size_bytes, std::align_val_t(alignment), std::nothrow);
  may_fail = outer;
  return block;
}

MemoryReserve::MemoryReserve(size_t size_bytes)
    : outer_(innermost), small_(size_bytes <= kSmallReserveBytes) {
  {
    const std::lock_guard lock(mutex);
    if (reserves++ == 0) handler_before = std::set_new_handler(handle);
    if (small_ && kept != nullptr) block_ = std::exchange(kept, kept->next);
  }
  if (block_ == nullptr) {
    const bool outer = std::exchange(may_fail, true);
    block_ = ::operator new(std::max(size_bytes, kSmallReserveBytes), std::nothrow);
    may_fail = outer;
  }
  innermost = this;
}

MemoryReserve::~MemoryReserve() {
  innermost = outer_;
  if (!small_) ::operator delete(block_);
  const std::lock_guard lock(mutex);
  if (small_ && block_ != nullptr) kept = ::new (block_) Kept{kept};
  if (--reserves == 0 && std::get_new_handler() == handle) std::set_new_handler(handler_before);
}

bool MemoryReserve::give_up_one() {
  for (MemoryReserve* reserve = innermost; reserve != nullptr; reserve = reserve->outer_) {
    if (reserve->block_ == nullptr) continue;
    ::operator delete(std::exchange(reserve->block_, nullptr));
    return true;
  }
  return false;
}

// operator new tries again after this returns.
void MemoryReserve::handle() {
  if (!may_fail && give_up_one()) return;
  if (const std::new_handler before = handler_before) return before();
  std::__throw_bad_alloc();  // by the standard library: this one is compiled without exceptions
}

}  // namespace figurine
