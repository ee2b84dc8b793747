#include "runtime/src/nn/xnnpack_memory.h"

#include <cstdlib>
#include <utility>

#include "figurine/detail/memory_reserve.h"

namespace figurine {
namespace {

constinit thread_local XnnpackRoom* of_thread = nullptr;

template <class Allocate>
void* allocate(size_t size_bytes, const Allocate& try_once) {
  if (of_thread != nullptr) of_thread->shrink(size_bytes);
  for (;;) {
    if (void* const block = try_once()) return block;
    if (of_thread != nullptr && of_thread->give_up()) continue;
    if (!MemoryReserve::give_up_one()) return nullptr;
  }
}

constexpr xnn_allocator kAllocator = {
    .context = nullptr,
    .allocate = [](void*,
                   size_t size) { return allocate(size, [=] { return std::malloc(size); }); },
    .reallocate =
        [](void*, void* block, size_t size) {
          return allocate(size, [=] { return std::realloc(block, size); });
        },
    .deallocate = [](void*, void* block) { std::free(block); },
    .aligned_allocate =
        [](void*, size_t alignment, size_t size) {
          return allocate(size + alignment, [=]() -> void* {
            void* block = nullptr;
            return ::posix_memalign(&block, alignment, size) == 0 ? block : nullptr;
          });
        },
    .aligned_deallocate = [](void*, void* block) { std::free(block); }};

}  // namespace

const xnn_allocator& xnnpack_allocator() { return kAllocator; }

XnnpackRoom::XnnpackRoom(size_t size_bytes)
    : block_(std::malloc(size_bytes)), size_bytes_(size_bytes) {
  of_thread = this;
}

XnnpackRoom::~XnnpackRoom() {
  of_thread = nullptr;
  std::free(block_);
}

void XnnpackRoom::shrink(size_t size_bytes) {
  if (block_ == nullptr) return;
  void* const less =
      size_bytes < size_bytes_ ? std::realloc(block_, size_bytes_ - size_bytes) : nullptr;
  if (less == nullptr) {
    give_up();
    return;
  }
  block_ = less;
  size_bytes_ -= size_bytes;
}

bool XnnpackRoom::give_up() {
  if (block_ == nullptr) return false;
  std::free(std::exchange(block_, nullptr));
  return true;
}

}  // namespace figurine
