#include "runtime/src/pose/body_grid.h"

#include <algorithm>
#include <new>
#include <vector>

#include "runtime/src/pose/body_blocks.h"

namespace figurine {

std::shared_ptr<const BodyGrid> BodyGrid::create(const Body& body, uint32_t size) {
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

// Taps of weight 0 count: their values are multiplied as the others' are.
bool BodyGrid::list_tapped(uint32_t blocks) {
  std::vector<uint32_t> all, of_block;
  if (!first_tapped_.ensure(size_t{blocks} + 1)) return false;
  for (uint32_t block = 0; block < blocks; ++block) {
    of_block.clear();
    if (of_texels()) {
      of_block.push_back(block);
    } else {
      for (const auto& rows : taps_[block].row) {
        for (const uint32_t row : rows) of_block.push_back(row / kernels::kLanes);
      }
      std::sort(of_block.begin(), of_block.end());
      of_block.erase(std::unique(of_block.begin(), of_block.end()), of_block.end());
    }
    all.insert(all.end(), of_block.begin(), of_block.end());
    first_tapped_[block + 1] = static_cast<uint32_t>(all.size());
  }
  tapped_count_ = all.size();
  if (!tapped_.ensure(all.size())) return false;
  std::copy(all.begin(), all.end(), tapped_.data());
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
