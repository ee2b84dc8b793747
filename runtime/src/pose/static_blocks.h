// An avatar's static part as the frame path reads it: brought from its grids to every texel and
// into blocks of planes, colours as their gain. Made once, when the avatar is added.
#pragma once

#include <cstddef>
#include <cstdint>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

class StaticBlocks {
 public:
  // The part must be sound for the body (its groups' grids, channels and counts); its arrays are
  // read here and not afterwards. kOutOfMemory.
  Status ensure(const StaticPart& part, const Body& body);

  // Null where the avatar has no static part.
  const kernels::StaticBlock* of(size_t block) const {
    return blocks_.data() == nullptr ? nullptr : &blocks_[block];
  }
  uint64_t memory_bytes() const { return blocks_.memory_bytes(); }

 private:
  Buffer<kernels::StaticBlock> blocks_;  // [blocks]
};

}  // namespace figurine
