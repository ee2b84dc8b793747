// Whether XNNPACK's loops run on threads that give way: how the runtime knows the drop-in
// (drop_in_pthreadpool.cpp) where one is linked, and where none is.
#pragma once

#include <cstddef>
#include <cstdint>

struct pthreadpool;

namespace figurine {

// The drop-in's functions by another way than their names, which may be the system's here and the
// drop-in's for XNNPACK, or the other way about: of several libraries that define a name, who finds
// which one depends on what the program loaded in which order.
struct DropInPthreadpool {
  pthreadpool* (*create)(size_t threads);
  void (*destroy)(pthreadpool* pool);
  uint64_t (*loops_alone)();  // of this thread so far, without a pool
};

}  // namespace figurine

// Null where no drop-in is linked: then all of the process has the system's.
extern "C" __attribute__((weak, visibility("default"))) const figurine::DropInPthreadpool*
figurine_drop_in_pthreadpool();
