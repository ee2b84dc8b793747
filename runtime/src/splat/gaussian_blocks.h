// Between arrays of Gaussians (figurine::GaussianView: files, static sets, export) and the blocks
// of planes that the frame path works on.
#pragma once

#include <algorithm>
#include <cstdint>

#include "figurine/gaussian.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

inline uint32_t block_count(uint32_t items) {
  return (items + kernels::kLanes - 1) / kernels::kLanes;
}
// Lanes of a block that hold an item, of so many items in all.
inline uint32_t lanes_of_block(uint32_t block, uint32_t items) {
  return std::min(kernels::kLanes, items - block * kernels::kLanes);
}

// Arrays behind a view of one avatar's Gaussians.
struct GaussianArrays {
  Buffer<float> position_m, covariance_factor, opacity, sh;

  bool ensure(uint32_t count, uint32_t sh_degree);  // false: no memory
  // The first lanes of a block become Gaussians kLanes * block and following.
  void store(const kernels::GaussianBlock& from, uint32_t block, uint32_t lanes,
             uint32_t sh_degree);
  GaussianView view(uint32_t count, uint32_t sh_degree) const;
  uint64_t memory_bytes() const {
    return position_m.memory_bytes() + covariance_factor.memory_bytes() + opacity.memory_bytes() +
           sh.memory_bytes();
  }
};

// Fills the lanes that the view has Gaussians for; returns their number.
uint32_t load_block(const GaussianView& view, uint32_t block, kernels::GaussianBlock& out);

}  // namespace figurine
