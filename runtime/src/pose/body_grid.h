// A grid over a body's texels as the frame path reads it: the cells that a network's maps are drawn
// for, and for every block of texels the cells that it lies between. Made once, shared by every
// avatar of the body whose network has this grid.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/body.h"
#include "figurine/texel_grid.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

class BodyGrid {
 public:
  // The size must fit the body (grid_fits); its arrays are read here and not afterwards. Null: no
  // memory.
  static std::shared_ptr<const BodyGrid> create(const Body& body, uint32_t size);

  uint32_t size() const { return grid_.size; }  // cells a side
  // Whether every texel is its own cell: then a block's cells are its texels, and there are no
  // taps.
  bool of_texels() const { return taps_.data() == nullptr; }

  std::span<const uint32_t> cell() const { return grid_.cell; }
  std::span<const uint32_t> source() const { return grid_.source; }
  std::span<const uint32_t> border_cell() const { return grid_.border_cell; }
  std::span<const uint32_t> border_source() const { return grid_.border_source; }
  uint32_t cell_count() const { return grid_.cell_count(); }
  uint32_t cell_blocks() const {  // of kLanes cells each, in the order of cell()
    return (cell_count() + kernels::kLanes - 1) / kernels::kLanes;
  }

  // Of a block of texels: null where every texel is its own cell.
  const kernels::TapBlock* taps(size_t block) const {
    return of_texels() ? nullptr : &taps_[block];
  }
  // Which blocks of cells a block of texels has taps in, ascending; of_texels: itself.
  std::span<const uint32_t> cell_blocks_of(size_t block) const {
    return tapped_.span(tapped_count_)
        .subspan(first_tapped_[block], first_tapped_[block + 1] - first_tapped_[block]);
  }

  uint64_t memory_bytes() const;

 private:
  BodyGrid() = default;
  bool lay_taps(const Body& body, uint32_t blocks);
  bool list_tapped(uint32_t blocks);

  TexelGrid grid_;
  Buffer<kernels::TapBlock> taps_;  // [blocks]
  Buffer<uint32_t> first_tapped_;   // [blocks + 1]
  Buffer<uint32_t> tapped_;         // the lists of cell_blocks_of, one after the other
  size_t tapped_count_ = 0;
};

}  // namespace figurine
