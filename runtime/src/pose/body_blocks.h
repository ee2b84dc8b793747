// A body's texels as the frame path reads them: in blocks of planes, made once and shared by every
// avatar of the body.
#pragma once

#include <cstdint>
#include <span>

#include "figurine/body.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

class BodyBlocks {
 public:
  // Reads the body's arrays here and not afterwards. False: no memory.
  bool ensure(const Body& body);

  uint32_t count() const { return count_; }
  uint32_t texels() const { return texels_; }
  const kernels::TexelBlock& operator[](size_t block) const { return blocks_[block]; }
  uint64_t memory_bytes() const { return blocks_.memory_bytes(); }

 private:
  uint32_t count_ = 0, texels_ = 0;
  Buffer<kernels::TexelBlock> blocks_;
};

// Index of the texel that a lane stands for: lanes behind the last texel repeat it.
inline uint32_t texel_of_lane(uint32_t block, uint32_t lane, uint32_t texels) {
  const uint32_t texel = block * kernels::kLanes + lane;
  return texel < texels ? texel : texels - 1;
}

}  // namespace figurine
