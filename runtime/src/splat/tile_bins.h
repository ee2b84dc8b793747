// Which splats a tile blends, front to back: a stable counting sort of (splat, tile) pairs by tile.
//
// Memory is bounded by the number of Gaussians and tiles alone. The pairs are not: where they do
// not fit the list, the image is drawn in bands of tiles, each of which does, and tiles are found
// for every band anew; where they do, once. Nothing allocates after prepare().
//
// Sorted splats are divided into sections of equal length, one a task; each counts its own pairs a
// tile, and a tile's pairs stand section by section, so the order is that of the sorted splats
// whatever the number of sections.
#pragma once

#include <cstdint>

#include "runtime/src/base/memory.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/kernel.h"
#include "runtime/src/splat/depth_sort.h"

namespace figurine {

class TileBins {
 public:
  explicit TileBins(ThreadPool& pool) : pool_(pool) {}

  // For an image of that size and at most so many splats. False: no memory.
  bool prepare(uint32_t width_px, uint32_t height_px, size_t splats);

  // Counts the pairs of sorted splats, which must stay where they are until the frame is drawn.
  // exact: a pair only where the splat's ellipse may reach the tile, not wherever its box does.
  void count(const kernels::Splat* splats, const DepthSort::Item* sorted, uint32_t sorted_count,
             bool exact);

  struct Band {
    uint32_t begin, end;  // tiles
  };
  // Tiles from `begin` on whose pairs fit the list, at least one; fills the list for them.
  Band fill_band(uint32_t begin);

  // Of a tile of the band that was filled last.
  const uint32_t* order(uint32_t tile) const { return pairs_.data() + begin_[tile]; }
  uint32_t count_of(uint32_t tile) const { return count_[tile]; }

  uint32_t tiles() const { return tiles_x_ * tiles_y_; }
  uint32_t tiles_x() const { return tiles_x_; }
  uint64_t pair_count() const { return pair_count_; }
  uint64_t missed_pairs() const { return missed_; }  // left out as exact said
  uint64_t memory_bytes() const;

 private:
  struct Pair {
    uint32_t slot, tile;
  };
  struct Section {
    uint64_t pairs, missed;
  };

  uint32_t first_of_section(uint32_t section) const;
  Pair* found_in(uint32_t section) { return found_.data() + size_t{section} * found_limit(); }
  size_t found_limit() const { return capacity_ / sections_; }  // of a section
  void count_section(uint32_t section);
  void fill_section(uint32_t section, const Band& band);
  template <class Visit>
  void for_each_tile(const kernels::Splat& splat, const Visit& visit) const;

  ThreadPool& pool_;
  uint32_t tiles_x_ = 0, tiles_y_ = 0, sections_ = 1;
  const kernels::Splat* splats_ = nullptr;
  const DepthSort::Item* sorted_ = nullptr;
  uint32_t sorted_count_ = 0;
  bool exact_ = true;
  uint64_t pair_count_ = 0, missed_ = 0;
  size_t capacity_ = 0;
  Buffer<uint32_t> pairs_;          // splats' slots, tile by tile, front to back
  Buffer<uint32_t> count_, begin_;  // [tiles] pairs, and where they stand within a band
  Buffer<uint32_t> section_count_;  // [sections,tiles] pairs, then where the next one goes
  Buffer<Pair> found_;              // [sections,found_limit()] while counting, splat by splat
  Buffer<Section> section_;         // [sections]
};

}  // namespace figurine
