// XNNPACK's memory: the C library's, by an allocator that has room kept for it before it says no.
// XNNPACK looks at some of its allocations and not at others: of 180 that it makes for a network,
// four ended the process when they failed and thirteen gave another picture.
#pragma once

#include <xnnpack.h>

#include <cstddef>

namespace figurine {

// For xnn_initialize(), whose first caller in a process decides for all. It must stay for as long
// as XNNPACK does: what links the runtime is linked with -z nodelete.
const xnn_allocator& xnnpack_allocator();

// Room for what XNNPACK allocates on this thread while the object lives. It shrinks by every
// allocation, so that both together are no more than was asked for, and is given up for one that
// fails. Local variables; they do not nest.
class XnnpackRoom {
 public:
  explicit XnnpackRoom(size_t size_bytes);
  ~XnnpackRoom();
  XnnpackRoom(const XnnpackRoom&) = delete;
  XnnpackRoom& operator=(const XnnpackRoom&) = delete;
  bool held() const { return block_ != nullptr; }  // false: no memory

  void shrink(size_t size_bytes);
  bool give_up();  // false if there is nothing left

 private:
  void* block_;
  size_t size_bytes_;
};

}  // namespace figurine
