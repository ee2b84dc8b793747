// An avatar's smallest extents as the frame path reads them, in blocks. Made once, when the avatar
// is added.
#pragma once

#include <cstddef>
#include <cstdint>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

class ExtentBlocks {
 public:
  // The extents must fit the body (validate_smallest_extents); they are read here and not
  // afterwards. kOutOfMemory.
  Status ensure(const SmallestExtents& extents, const Body& body);

  // Null where the avatar has none.
  const kernels::ExtentBlock* of(size_t block) const {
    return blocks_.data() == nullptr ? nullptr : &blocks_[block];
  }
  float largest_m() const { return largest_m_; }  // of all; 0 where there are none
  uint64_t memory_bytes() const { return blocks_.memory_bytes(); }

 private:
  Buffer<kernels::ExtentBlock> blocks_;  // [blocks]
  float largest_m_ = 0;
};

}  // namespace figurine
