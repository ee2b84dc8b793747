#include "runtime/src/pose/body_grid.h"

#include <algorithm>
#include <array>
#include <new>
#include <vector>

#include "figurine/detail/memory_reserve.h"
#include "runtime/src/pose/body_blocks.h"

namespace figurine {

namespace {

// Of the lists over texels and cells at once: the grid's four, which grow twofold, and beside them
// a texel's taps, its chart and the rows that find it, or what covers a cell and how far from it.
size_t list_bytes(const Body& body, uint32_t size) {
  const size_t cells = size_t{size} * size, map = size_t{body.uv_size} * body.uv_size;
  constexpr size_t kLists = 4, kGrowth = 3;
  const size_t grid = kLists * kGrowth * cells * sizeof(uint32_t),
               taps = size == body.uv_size
                          ? 0
                          : body.texel_count() * (sizeof(GridTaps) + kGrowth * sizeof(uint32_t)) +
                                (map + cells) * sizeof(uint32_t);
  return grid + std::max(taps, 3 * cells * sizeof(uint32_t)) + kSmallReserveBytes;
}

}  // namespace

std::shared_ptr<const BodyGrid> BodyGrid::create(const Body& body, uint32_t size) {
  const MemoryReserve reserve(list_bytes(body, size));
  if (!reserve.held()) return nullptr;
  std::shared_ptr<BodyGrid> grid(new (std::nothrow) BodyGrid());
  if (grid == nullptr) return nullptr;
  grid->grid_ = make_texel_grid(body, size);
  const uint32_t blocks = (body.texel_count() + kernels::kLanes - 1) / kernels::kLanes;
  if (size != body.uv_size && !grid->lay_taps(body, blocks)) return nullptr;
  if (!grid->list_tapped(blocks)) return nullptr;
  return grid;
}

bool BodyGrid::lay_taps(const Body& body, uint32_t blocks) {
  if (!taps_.ensure(blocks)) return false;
  const std::vector<GridTaps> taps = make_grid_taps(body, grid_);
  for (uint32_t block = 0; block < blocks; ++block) {
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const GridTaps& of_texel = taps[texel_of_lane(block, lane, body.texel_count())];
      for (uint32_t k = 0; k < kernels::kTaps; ++k) {
        taps_[block].row[k][lane] = of_texel.row[k];
        taps_[block].weight[k][lane] = of_texel.weight[k];
      }
    }
  }
  return true;
}

// Cells that the texels of a block tap.
constexpr size_t kMostTapped = kernels::kTaps * kernels::kLanes;

// Taps of weight 0 count: their values are multiplied as the others' are.
bool BodyGrid::list_tapped(uint32_t blocks) {
  const auto find_tapped = [&](uint32_t block, std::array<uint32_t, kMostTapped>& tapped) {
    if (of_texels()) {
      tapped[0] = block;
      return size_t{1};
    }
    size_t count = 0;
    for (const auto& rows : taps_[block].row) {
      for (const uint32_t row : rows) tapped[count++] = row / kernels::kLanes;
    }
    std::sort(tapped.begin(), tapped.end());
    return static_cast<size_t>(std::unique(tapped.begin(), tapped.end()) - tapped.begin());
  };
  if (!first_tapped_.ensure(size_t{blocks} + 1)) return false;
  std::array<uint32_t, kMostTapped> tapped{};
  for (uint32_t block = 0; block < blocks; ++block)
    first_tapped_[block + 1] =
        first_tapped_[block] + static_cast<uint32_t>(find_tapped(block, tapped));
  tapped_count_ = first_tapped_[blocks];
  if (!tapped_.ensure(tapped_count_)) return false;
  for (uint32_t block = 0; block < blocks; ++block) {
    const size_t count = find_tapped(block, tapped);
    std::copy_n(tapped.begin(), count, tapped_.data() + first_tapped_[block]);
  }
  return true;
}

uint64_t BodyGrid::memory_bytes() const {
  uint64_t bytes = taps_.memory_bytes() + first_tapped_.memory_bytes() + tapped_.memory_bytes();
  for (const std::vector<uint32_t>* rows :
       {&grid_.cell, &grid_.source, &grid_.border_cell, &grid_.border_source}) {
    bytes += rows->capacity() * sizeof(uint32_t);
  }
  return bytes;
}

}  // namespace figurine
