// Room for an operation's small things: names, lists, messages, which std::string and std::vector
// hold and which cannot say no in a library without exceptions.
//
// Whoever begins an operation takes a reserve of what such things may need at most, and says no if
// it cannot be had. If later an allocation fails, the reserve is given up for it, by the handler
// that operator new asks before it throws (std::set_new_handler): the operation comes to its end.
// What grows with images and networks is no matter of reserves: it asks by try_allocate(), which
// says no and leaves them alone. docs/decisions/0051-out-of-memory.md.
#pragma once

#include <cstddef>

#include "figurine/status.h"

namespace figurine {

// For operations whose containers hold messages and little more.
inline constexpr size_t kSmallReserveBytes = 16 << 10;

// A local variable of the thread that runs the operation; reserves nest. Those of up to
// kSmallReserveBytes are kept for the next and cost no allocation then.
//
// While any thread holds one, the process's new-handler is ours. Threads that hold none are handed
// on to the handler of before, or get the std::bad_alloc that they would have got.
class MemoryReserve {
 public:
  explicit MemoryReserve(size_t size_bytes = kSmallReserveBytes);
  ~MemoryReserve();
  MemoryReserve(const MemoryReserve&) = delete;
  MemoryReserve& operator=(const MemoryReserve&) = delete;

  // False where there was no memory for it, and after it was given up.
  bool held() const { return block_ != nullptr; }

  // For an allocator that is not operator new: gives up the innermost reserve of this thread that
  // is still held. False if there is none: then there is nothing to try again for.
  static bool give_up_one();

 private:
  static void handle();

  MemoryReserve* const outer_;  // of the same thread
  const bool small_;
  void* block_ = nullptr;
};

// kOutOfMemory, "no memory": of a length that allocates nothing, for where there was no reserve.
Status no_memory();

// As operator new, null where there is no memory; no reserve is given up for it. To be freed by
// operator delete with the alignment, which is a power of two.
void* try_allocate(size_t size_bytes, size_t alignment);

}  // namespace figurine
